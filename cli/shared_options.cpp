// SPDX-License-Identifier: Apache-2.0
#include <iostream>

#include "cli/commands.h"
#include "core/error.h"
#include "core/simd/kernels.h"

namespace nerfvdb {

void SharedOptions::add(CLI::App& command, const std::string& example) {
    command.add_option("--threads", threads_, "Number of threads; results do not depend on it [all cores]")
        ->check(CLI::Range(1, 4096))
        ->type_name("N");
    command.add_option("--simd", simd_, "Instruction set of the inner loops; results differ in their last bits [the best there is]")
        ->check(CLI::IsMember(simd::supportedTargets()))
        ->type_name("NAME");
    command.add_option("--json", json_, "Also write the results as JSON; - is standard output")
        ->type_name("FILE");
    command.set_version_flag("--version", "nerfvdb " NERFVDB_VERSION);
    command.footer("Example:\n" + example);
}

std::unique_ptr<ThreadLimit> SharedOptions::begin() const {
    checkJsonTarget(json_);
    if (!simd_.empty()) simd::forceTarget(simd_);
    return std::make_unique<ThreadLimit>(threads_);
}

void SharedOptions::finish(const Json& json, const std::string& text) const {
    if (json_ != "-") std::cout << text << std::flush;
    writeJson(json_, json);
    std::cout.flush();
    if (!std::cout)
        throw IoError("standard output", "a failed write", "room for the results", "is the disk full?");
}

}  // namespace nerfvdb
