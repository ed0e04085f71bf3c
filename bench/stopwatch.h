// SPDX-License-Identifier: Apache-2.0
// Two clocks at once: the one on the wall, and the one that counts what all threads of this process got of the
// processor. On a machine that others use too, the second is the fairer.
#pragma once

#include "core/clock.h"

namespace nerfvdb {

/// Adds up the time between start() and pause(), any number of times. Stands still when it is made.
class Stopwatch {
public:
    void start() {
        if (runs_) return;
        runs_ = true;
        wall_begin_ = Clock();
        cpu_begin_ = processCpuSeconds();
    }
    void pause() {
        wall_ = wallSeconds();
        cpu_ = cpuSeconds();
        runs_ = false;
    }
    double wallSeconds() const {
        return wall_ + (runs_ ? wall_begin_.seconds() : 0.0);
    }
    double cpuSeconds() const { return cpu_ + (runs_ ? processCpuSeconds() - cpu_begin_ : 0.0); }

private:
    bool runs_ = false;
    double wall_ = 0, cpu_ = 0, cpu_begin_ = 0;
    Clock wall_begin_;
};

}  // namespace nerfvdb
