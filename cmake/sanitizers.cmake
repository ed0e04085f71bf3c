# SPDX-License-Identifier: Apache-2.0
# NERFVDB_SANITIZE=address,undefined or =thread: for every target, since half a program cannot be checked.
if(NERFVDB_SANITIZE)
  add_compile_options(-fsanitize=${NERFVDB_SANITIZE} -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${NERFVDB_SANITIZE})
  if(NERFVDB_SANITIZE MATCHES "undefined")
    add_compile_options(-fno-sanitize-recover=undefined)
    if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
      add_compile_options(-fsanitize-ignorelist=${PROJECT_SOURCE_DIR}/cmake/ubsan.ignore)
    endif()
  endif()
endif()
