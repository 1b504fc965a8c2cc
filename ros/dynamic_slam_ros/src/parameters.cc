#include "parameters.h"

#include <algorithm>

#include <fmt/core.h>
#include <ros/param.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {
namespace {

void AddAssignments(const std::string& key, XmlRpc::XmlRpcValue& value,
                    std::vector<std::string>* assignments) {
  std::string text;
  switch (value.getType()) {
    case XmlRpc::XmlRpcValue::TypeStruct:
      for (auto& [name, member] : value) AddAssignments(key + "." + name, member, assignments);
      return;
    case XmlRpc::XmlRpcValue::TypeBoolean:
      text = static_cast<bool>(value) ? "true" : "false";
      break;
    case XmlRpc::XmlRpcValue::TypeInt:
      text = fmt::format("{}", static_cast<int>(value));
      break;
    case XmlRpc::XmlRpcValue::TypeDouble:
      text = ShortestDouble(static_cast<double>(value));
      break;
    case XmlRpc::XmlRpcValue::TypeString:
      text = static_cast<std::string>(value);
      break;
    default:
      throw InputError("~" + key, "is a list or binary", "Give a number, a text or true or false.");
  }
  assignments->push_back(key + "=" + text);
}

}  // namespace

void ReadParameters(const ros::NodeHandle& node, std::span<const OptionEntry> entries,
                    const std::vector<std::string>& others) {
  XmlRpc::XmlRpcValue all;
  if (!ros::param::get(node.getNamespace(), all) || all.getType() != XmlRpc::XmlRpcValue::TypeStruct) return;
  std::vector<std::string> assignments;
  for (auto& [name, value] : all) {
    if (std::find(others.begin(), others.end(), name) == others.end())
      AddAssignments(name, value, &assignments);
  }
  ApplySetEntries(entries, assignments, "parameter of " + node.getNamespace());
}

}  // namespace dynamic_slam
