// SPDX-License-Identifier: Apache-2.0
#include "cli/process.h"

#include <malloc.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <sstream>
#include <string>

namespace nerfvdb {
namespace {

const auto static_start = std::chrono::steady_clock::now();

/// Start of the process in seconds since boot: field 22 of /proc/self/stat (proc(5)), or -1.
double processStartSinceBoot() {
    std::ifstream file("/proc/self/stat");
    std::string line;
    if (!std::getline(file, line)) return -1;
    // The program's name stands in parentheses and may hold spaces: count fields after it, from the third.
    std::istringstream fields(line.substr(line.rfind(')') + 1));
    std::string field;
    for (int number = 3; number <= 22; ++number)
        if (!(fields >> field)) return -1;
    return std::stod(field) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

}  // namespace

double secondsSinceProcessStart() {
    static const double start = processStartSinceBoot();
    timespec now{};
    if (start >= 0 && clock_gettime(CLOCK_BOOTTIME, &now) == 0) {
        const double seconds =
            static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec) - start;
        // A container may count its boot differently from its host: believe only what is plausible.
        const double at_least =
            std::chrono::duration<double>(std::chrono::steady_clock::now() - static_start).count();
        if (seconds >= at_least && seconds < at_least + 60) return seconds;
    }
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - static_start).count();
}

void giveBackFreedMemory() {
#ifdef __GLIBC__
    constexpr int kLarge = 1 << 20;  // bytes
    mallopt(M_MMAP_THRESHOLD, kLarge);  // once said, it no longer grows with what is freed
#endif
}

std::uint64_t peakMemoryBytes() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;  // Linux counts kilobytes
}

}  // namespace nerfvdb
