# ROS 1, as Debian packages it or as a sourced setup.bash names it: the target Ros::Ros, or Ros_FOUND false.
#
# ROS's own CMake files are not used: they run whichever Python comes first in PATH and fail unless it is Debian's.
# Headers that C++20 refuses are put right by ros/dynamic_slam_ros/generate_messages.py.

set(Ros_PARTS roscpp rosconsole rostime roscpp_serialization xmlrpcpp cpp_common console_bridge rosbag_storage tf2_ros tf2
    diagnostic_updater boost_thread boost_system)
set(Ros_LIBRARIES "")
set(Ros_MISSING "")
foreach(part ${Ros_PARTS})
  find_library(ROS_LIBRARY_${part} ${part})
  mark_as_advanced(ROS_LIBRARY_${part})
  list(APPEND Ros_LIBRARIES ${ROS_LIBRARY_${part}})
  if(NOT ROS_LIBRARY_${part})
    list(APPEND Ros_MISSING lib${part})
  endif()
endforeach()

# Debian keeps some headers one folder deeper than they are included.
set(Ros_INCLUDE_DIRS "")
foreach(header ros/ros.h pluginlib/class_loader.hpp class_loader/class_loader.hpp rcutils/allocator.h
        rcpputils/filesystem_helper.hpp ament_index_cpp/get_package_prefix.hpp)
  get_filename_component(part ${header} DIRECTORY)
  find_path(ROS_INCLUDE_${part} ${header} PATH_SUFFIXES ${part})
  mark_as_advanced(ROS_INCLUDE_${part})
  if(ROS_INCLUDE_${part})
    list(APPEND Ros_INCLUDE_DIRS ${ROS_INCLUDE_${part}})
  elseif(part STREQUAL ros)
    list(APPEND Ros_MISSING ${header})
  endif()
endforeach()

# The Python that has the generators.
find_program(ROS_PYTHON python3 PATHS /usr/bin NO_DEFAULT_PATH)
if(ROS_PYTHON)
  execute_process(COMMAND ${ROS_PYTHON} -c "import gencpp, genmsg, genpy" RESULT_VARIABLE failed ERROR_QUIET)
  if(failed)
    list(APPEND Ros_MISSING "the message generators")
  endif()
endif()
find_path(ROS_SHARE std_msgs/msg/Header.msg PATHS /usr/share PATH_SUFFIXES share)
mark_as_advanced(ROS_PYTHON ROS_SHARE)

include(FindPackageHandleStandardArgs)
set(Ros_IS_COMPLETE NOTFOUND)
if(NOT Ros_MISSING)
  set(Ros_IS_COMPLETE TRUE)
endif()
find_package_handle_standard_args(Ros REQUIRED_VARS Ros_IS_COMPLETE ROS_PYTHON ROS_SHARE)

if(Ros_FOUND AND NOT TARGET Ros::Ros)
  add_library(Ros::Ros INTERFACE IMPORTED)
  target_include_directories(Ros::Ros SYSTEM INTERFACE ${Ros_INCLUDE_DIRS})
  target_link_libraries(Ros::Ros INTERFACE ${Ros_LIBRARIES})
endif()
