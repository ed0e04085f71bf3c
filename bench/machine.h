// SPDX-License-Identifier: Apache-2.0
// What a measurement depends on beside the code that it measures: which program, which machine, how busy.
#pragma once

#include <string>

namespace nerfvdb {

struct RunFacts {
    std::string version;  // of the program
    std::string commit;   // of its source, with "+" when files differed from it; "unknown" outside a repository
    std::string compiler;     // such as "g++ 12.2.0, Release"
    std::string cpu;          // model name
    int cores = 0;            // that this process may use
    int threads = 0;          // that it was allowed to use
    std::string simd_target;  // kernels' instruction set
    std::string date;         // UTC, ISO 8601
    double load = 0;          // processes that wanted to run before this one began: mean of the last minute
    double yardstick_s = 0;   // time of a fixed piece of work: tells a slower machine from slower code
};

/// Looks around; takes about a tenth of a second for the yardstick.
RunFacts gatherFacts();

/// One line for beneath a plot. Nothing in it changes from run to run of one program on one machine.
std::string factsLine(const RunFacts& facts);

/// Seconds for a fixed chain of 2^18 dependent reads from a 16 MiB table with integer arithmetic between them,
/// on one thread; the median of five.
double yardstickSeconds();

}  // namespace nerfvdb
