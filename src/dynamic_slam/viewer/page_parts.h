#pragma once

namespace dynamic_slam {

// The files of viewer/page, and three.js with its control by mouse and touch, which CMake puts into the
// program.
extern const char kViewerHtml[], kViewerStyle[], kViewerMap[], kViewerVideo[], kViewerScript[];
extern const char kThree[], kThreeOrbit[];

}  // namespace dynamic_slam
