# SPDX-License-Identifier: Apache-2.0
# Warnings in one place: link nerfvdb_warnings, privately.
add_library(nerfvdb_warnings INTERFACE)
target_compile_options(nerfvdb_warnings INTERFACE -Wall -Wextra -Wshadow)
# Only where the warnings are known: another compiler's new ones must not break a build.
if(NERFVDB_WERROR AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # These three follow the optimiser's guesses through inlined templates of other libraries.
  target_compile_options(nerfvdb_warnings INTERFACE -Werror -Wno-error=maybe-uninitialized
    -Wno-error=array-bounds -Wno-error=stringop-overflow)
endif()
