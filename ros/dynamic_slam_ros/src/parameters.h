#pragma once

#include <span>
#include <string>
#include <vector>

#include <ros/node_handle.h>

#include "dynamic_slam/base/options.h"

namespace dynamic_slam {

// Sets the options whose keys are parameters in the node handle's namespace; those that are not there keep
// their value. A dot in a key is a level of the parameters. Parameters and sections in `others` are left
// alone. Throws InputError that lists every problem: one that is no option, a wrong type, a value out of
// range.
void ReadParameters(const ros::NodeHandle& node, std::span<const OptionEntry> entries,
                    const std::vector<std::string>& others = {});

}  // namespace dynamic_slam
