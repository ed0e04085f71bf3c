# SPDX-License-Identifier: Apache-2.0
# NERFVDB_SANITIZE=address,undefined or =thread: for every target, since half a program cannot be checked.
if(NERFVDB_SANITIZE)
  add_compile_options(-fsanitize=${NERFVDB_SANITIZE} -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${NERFVDB_SANITIZE})
  if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")  # GCC says so itself
    if(NERFVDB_SANITIZE MATCHES "address")
      add_compile_definitions(__SANITIZE_ADDRESS__)
    elseif(NERFVDB_SANITIZE MATCHES "thread")
      add_compile_definitions(__SANITIZE_THREAD__)
    endif()
  endif()
  if(NERFVDB_SANITIZE MATCHES "undefined")
    add_compile_options(-fno-sanitize-recover=undefined)
    if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
      add_compile_options(-fsanitize-ignorelist=${PROJECT_SOURCE_DIR}/cmake/ubsan.ignore)
    endif()
  endif()
endif()
