#pragma once

namespace dynamic_slam {

// The files of report/page, which CMake puts into the program.
extern const char kPageHtml[], kPageStyle[], kPageScript[];

}  // namespace dynamic_slam
