# SPDX-License-Identifier: Apache-2.0
# What find_package(nerfvdb) needs: exported targets, their dependencies, and our find modules beside them.
include(CMakePackageConfigHelpers)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/nerfvdb)
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/nerfvdb-config.cmake.in
  ${PROJECT_BINARY_DIR}/nerfvdb-config.cmake INSTALL_DESTINATION ${package_dir})
# Before 1.0 a minor version may change interfaces.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/nerfvdb-config-version.cmake
  COMPATIBILITY SameMinorVersion)

install(EXPORT nerfvdb NAMESPACE nerfvdb:: DESTINATION ${package_dir} FILE nerfvdb-targets.cmake)
install(FILES
  ${PROJECT_BINARY_DIR}/nerfvdb-config.cmake
  ${PROJECT_BINARY_DIR}/nerfvdb-config-version.cmake
  ${PROJECT_SOURCE_DIR}/cmake/FindOpenVDB.cmake
  ${PROJECT_SOURCE_DIR}/cmake/FindOpenImageIO.cmake
  DESTINATION ${package_dir})
