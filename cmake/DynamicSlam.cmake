# Helpers that every layer member uses: one library, one test binary.

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM)
  set(CMAKE_CXX_COMPILER_LAUNCHER "${CCACHE_PROGRAM}")
endif()
find_program(MOLD_PROGRAM mold)
if(MOLD_PROGRAM)
  add_link_options(-fuse-ld=mold)
endif()

# The members are in the program and in libdynamic_slam.so, which shows only what DYNAMIC_SLAM_API says (base/export.h).
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_CXX_VISIBILITY_PRESET hidden)
set(CMAKE_VISIBILITY_INLINES_HIDDEN ON)

add_compile_options(-Wall -Wextra -Wshadow -Wnon-virtual-dtor -fno-math-errno -fno-semantic-interposition)
if(DYNAMIC_SLAM_SANITIZE)
  add_compile_options(-fsanitize=${DYNAMIC_SLAM_SANITIZE} -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${DYNAMIC_SLAM_SANITIZE})
endif()

# What hostile input finds first, and what makes a bug of ours harder to use. Sanitizers bring their own.
option(DYNAMIC_SLAM_HARDEN "Guards of stacks and C functions, addresses that vary, tables that are read-only" ON)
if(DYNAMIC_SLAM_HARDEN AND NOT DYNAMIC_SLAM_SANITIZE)
  add_compile_options($<$<CONFIG:Release,RelWithDebInfo>:-U_FORTIFY_SOURCE> $<$<CONFIG:Release,RelWithDebInfo>:-D_FORTIFY_SOURCE=2>
                      -fstack-protector-strong)
  add_link_options(-Wl,-z,relro,-z,now)
  include(CheckPIESupported)
  check_pie_supported()
endif()

# ds_library(member SOURCES a.cc DEPS base Eigen3::Eigen TESTS a_test.cc)
#
# Makes the library dynamic_slam_<member>, linked to the members and the targets in DEPS, and, when there
# are TESTS, the test binary <member>_test with the label LABEL (unit unless given).
function(ds_library member)
  cmake_parse_arguments(ARG "" "LABEL" "SOURCES;DEPS;TESTS;TEST_DEPS" ${ARGN})
  set(target dynamic_slam_${member})
  if(ARG_SOURCES)
    add_library(${target} STATIC ${ARG_SOURCES})
    set(visibility PUBLIC)
  else()
    add_library(${target} INTERFACE)
    set(visibility INTERFACE)
  endif()
  target_include_directories(${target} ${visibility} "${PROJECT_SOURCE_DIR}/include" "${PROJECT_SOURCE_DIR}/src")
  ds_resolve_deps(deps ${ARG_DEPS})
  target_link_libraries(${target} ${visibility} ${deps})
  if(DYNAMIC_SLAM_TESTS AND ARG_TESTS)
    if(NOT ARG_LABEL)
      set(ARG_LABEL unit)
    endif()
    add_executable(${member}_test ${ARG_TESTS})
    ds_resolve_deps(test_deps ${ARG_TEST_DEPS})
    target_link_libraries(${member}_test PRIVATE ${target} ${test_deps} GTest::gmock GTest::gtest_main)
    gtest_discover_tests(${member}_test PROPERTIES LABELS ${ARG_LABEL} TIMEOUT 600 DISCOVERY_TIMEOUT 60)
  endif()
endfunction()

# Turns member names into target names; leaves everything else as it is.
function(ds_resolve_deps out)
  set(result "")
  foreach(dep ${ARGN})
    if(EXISTS "${PROJECT_SOURCE_DIR}/src/dynamic_slam/${dep}/CMakeLists.txt")
      list(APPEND result dynamic_slam_${dep})
    else()
      list(APPEND result ${dep})
    endif()
  endforeach()
  set(${out} "${result}" PARENT_SCOPE)
endfunction()
