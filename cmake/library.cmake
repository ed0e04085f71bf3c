# SPDX-License-Identifier: Apache-2.0

# nerfvdb_library(FOLDER SOURCE...) makes the library of one folder: target nerfvdb_FOLDER, known to others as
# nerfvdb::FOLDER, installed with the folder's headers.
function(nerfvdb_library folder)
  add_library(nerfvdb_${folder} STATIC ${ARGN})
  add_library(nerfvdb::${folder} ALIAS nerfvdb_${folder})
  set_target_properties(nerfvdb_${folder} PROPERTIES EXPORT_NAME ${folder})
  target_compile_features(nerfvdb_${folder} PUBLIC cxx_std_20)
  target_include_directories(nerfvdb_${folder} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/nerfvdb>)
  target_link_libraries(nerfvdb_${folder} PRIVATE $<BUILD_INTERFACE:nerfvdb_warnings>)

  install(TARGETS nerfvdb_${folder} EXPORT nerfvdb ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  install(DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/nerfvdb/${folder}
          FILES_MATCHING PATTERN "*.h" PATTERN "*.inl")
endfunction()
