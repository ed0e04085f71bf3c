# SPDX-License-Identifier: Apache-2.0
# Run by CTest; see CMakeLists.txt.
function(must)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT result EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\nfailed with ${result}:\n${output}")
  endif()
endfunction()

file(REMOVE_RECURSE ${scratch_dir})
must(${CMAKE_COMMAND} --install ${build_dir} --prefix ${scratch_dir}/prefix)
must(${CMAKE_COMMAND} -S ${source_dir} -B ${scratch_dir}/example -G ${generator}
     -D CMAKE_PREFIX_PATH=${scratch_dir}/prefix -D CMAKE_CXX_COMPILER=${compiler}
     -D CMAKE_BUILD_TYPE=${build_type})
must(${CMAKE_COMMAND} --build ${scratch_dir}/example)
must(${scratch_dir}/example/sphere_to_blender ${scratch_dir}/sphere.vdb)
if(NOT EXISTS ${scratch_dir}/sphere.vdb)
  message(FATAL_ERROR "the example wrote nothing")
endif()
