# SPDX-License-Identifier: Apache-2.0
# cmake -DSOURCE=... -DOUTPUT=... -DVERSION=... -DCOMPILER=... -P build_facts.cmake
# Writes what measurements say of the program that made them. Runs at every build, so that the commit is the one that
# was built; the header is only touched when something in it changed.
set(commit unknown)
find_program(GIT_PROGRAM git)
if(GIT_PROGRAM)
  execute_process(COMMAND ${GIT_PROGRAM} -C ${SOURCE} describe --always --exclude=* --abbrev=10 --dirty=+
                  OUTPUT_VARIABLE described OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE status)
  if(status EQUAL 0)
    set(commit ${described})
  endif()
endif()
file(CONFIGURE OUTPUT ${OUTPUT} CONTENT [[
// Written by cmake/build_facts.cmake.
#pragma once

namespace nerfvdb {

inline constexpr const char* kBuildVersion = "@VERSION@";
inline constexpr const char* kBuildCommit = "@commit@";
inline constexpr const char* kBuildCompiler = "@COMPILER@";

}  // namespace nerfvdb
]] @ONLY)
