// SPDX-License-Identifier: Apache-2.0
#include "bench/peak_memory.h"

#include <malloc.h>

#include <algorithm>
#include <fstream>
#include <string>

namespace nerfvdb {
namespace {

/// A line of /proc/self/status such as "VmHWM:  1234 kB", in bytes.
std::int64_t statusBytes(const std::string& key) {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);)
        if (line.rfind(key, 0) == 0) return std::stoll(line.substr(key.size())) * 1024;
    return 0;
}

}  // namespace

PeakMemory::PeakMemory() {
    malloc_trim(0);
    std::ofstream("/proc/self/clear_refs") << "5";
    before_ = statusBytes("VmRSS:");
}

std::int64_t PeakMemory::extraBytes() const {
    return std::max<std::int64_t>(0, statusBytes("VmHWM:") - before_);
}

}  // namespace nerfvdb
