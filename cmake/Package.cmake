# What an installation has beside the program, the library and its headers, and the Debian package of it: cpack.

set(data "${CMAKE_INSTALL_DATADIR}/dynamic_slam")
install(DIRECTORY "${PROJECT_SOURCE_DIR}/config" DESTINATION ${data})
# Detector files name the networks by paths that begin at config/detectors.
install(FILES "${PROJECT_SOURCE_DIR}/models/builtin.onnx" "${PROJECT_SOURCE_DIR}/models/builtin_anchors.txt"
        DESTINATION ${data}/models)
install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION ${CMAKE_INSTALL_DOCDIR} RENAME copyright)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME dynamic-slam)
set(CPACK_PACKAGE_CONTACT "the Dynamic-SLAM authors <dynamic-slam@localhost>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_DESCRIPTION
    "path of one camera among people and cars, and a map
 Dynamic-SLAM follows one camera through a video or a folder of images in which
 people and cars may move, and makes a sparse map of what stands still. With the
 program come a C++ library, cameras, scenes and a small detector.")
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
# The cache of shared libraries is renewed.
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS_POLICY "=")
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "python3-numpy")
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "libopencv-dev, libeigen3-dev")
include(CPack)
