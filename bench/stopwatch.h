// SPDX-License-Identifier: Apache-2.0
// Two clocks at once: the one on the wall, and the one that counts what all threads of this process got of the
// processor. On a machine that others use too, the second is the fairer.
#pragma once

#include <sys/resource.h>

#include <chrono>

namespace nerfvdb {

/// Processor time of all threads of this process so far, user and system, seconds.
inline double processCpuSeconds() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    const auto seconds = [](const timeval& time) {
        return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
    };
    return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// Adds up the time between start() and pause(), any number of times. Stands still when it is made.
class Stopwatch {
public:
    void start() {
        if (runs_) return;
        runs_ = true;
        wall_begin_ = Clock::now();
        cpu_begin_ = processCpuSeconds();
    }
    void pause() {
        wall_ = wallSeconds();
        cpu_ = cpuSeconds();
        runs_ = false;
    }
    double wallSeconds() const {
        return wall_ + (runs_ ? std::chrono::duration<double>(Clock::now() - wall_begin_).count() : 0.0);
    }
    double cpuSeconds() const { return cpu_ + (runs_ ? processCpuSeconds() - cpu_begin_ : 0.0); }

private:
    using Clock = std::chrono::steady_clock;
    bool runs_ = false;
    double wall_ = 0, cpu_ = 0, cpu_begin_ = 0;
    Clock::time_point wall_begin_;
};

}  // namespace nerfvdb
