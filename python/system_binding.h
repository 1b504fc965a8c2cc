#pragma once

#include <pybind11/pybind11.h>

namespace dynamic_slam {

// Adds System and what its process returns.
void BindSystem(pybind11::module_& module);

}  // namespace dynamic_slam
