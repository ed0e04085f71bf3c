// SPDX-License-Identifier: Apache-2.0
#include "bench/machine.h"

#include <cstdio>
#include <ctime>
#include <fstream>
#include <thread>
#include <vector>

#include "bench/build_facts.h"
#include "bench/repeat.h"
#include "bench/stopwatch.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/simd/kernels.h"

namespace nerfvdb {
namespace {

/// The first processor's name, as Linux tells it (proc(5)).
std::string cpuName() {
    std::ifstream file("/proc/cpuinfo");
    for (std::string line; std::getline(file, line);) {
        if (line.rfind("model name", 0) != 0) continue;
        const std::size_t colon = line.find(": ");
        if (colon != std::string::npos) return line.substr(colon + 2);
    }
    return "unknown processor";
}

double loadAverage() {
    double load = 0;
    std::ifstream("/proc/loadavg") >> load;
    return load;
}

std::string utcNow() {
    const std::time_t now = std::time(nullptr);
    std::tm parts{};
    gmtime_r(&now, &parts);
    char text[32];
    std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
    return text;
}

}  // namespace

double yardstickSeconds() {
    constexpr int kReads = 1 << 18;
    constexpr std::uint32_t kEntries = 1 << 22;
    std::vector<std::uint32_t> table(kEntries);
    for (std::uint32_t i = 0; i < kEntries; ++i) table[i] = static_cast<std::uint32_t>(mixBits(i));
    std::vector<double> seconds;
    volatile std::uint64_t keep = 0;
    for (int repeat = 0; repeat < 5; ++repeat) {
        Stopwatch watch;
        watch.start();
        std::uint64_t at = static_cast<std::uint64_t>(repeat);
        for (int i = 0; i < kReads; ++i) at = mixBits(at ^ table[at % kEntries]);
        watch.pause();
        keep = keep + at;
        seconds.push_back(watch.wallSeconds());
    }
    return summarize(seconds).median;
}

RunFacts gatherFacts() {
    RunFacts facts;
    facts.version = kBuildVersion;
    facts.commit = kBuildCommit;
    facts.compiler = kBuildCompiler;
    facts.cpu = cpuName();
    facts.cores = static_cast<int>(std::thread::hardware_concurrency());
    facts.threads = threadCount();
    facts.simd_target = simd::activeTarget();
    facts.date = utcNow();
    facts.load = loadAverage();
    facts.yardstick_s = yardstickSeconds();
    return facts;
}

std::string factsLine(const RunFacts& facts) {
    return facts.cpu + ", " + std::to_string(facts.threads) + " of " + std::to_string(facts.cores) +
           (facts.cores == 1 ? " core, " : " cores, ") + facts.simd_target + ", " + facts.compiler +
           ", nerfvdb " + facts.version + " at " + facts.commit;
}

}  // namespace nerfvdb
