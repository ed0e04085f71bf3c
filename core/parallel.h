// SPDX-License-Identifier: Apache-2.0
// The only door to TBB. Work is cut into pieces whose bounds never depend on the number of threads, so that
// whatever a piece computes is the same on one thread and on sixteen.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>

#include <cstddef>
#include <memory>

#ifdef __SANITIZE_THREAD__  // of GCC
#include <sanitizer/tsan_interface.h>
#endif

namespace nerfvdb {

/// The order that a parallel loop promises: what was before it happens before its tasks, and they before what comes
/// after. Costs nothing but under ThreadSanitizer, which cannot see it inside the packaged TBB.
class LoopOrder {
public:
#ifdef __SANITIZE_THREAD__
    LoopOrder() { __tsan_release(&begun_); }
    ~LoopOrder() { __tsan_acquire(&ended_); }
    void beginTask() { __tsan_acquire(&begun_); }
    void endTask() { __tsan_release(&ended_); }

private:
    char begun_ = 0, ended_ = 0;
#else
    void beginTask() {}
    void endTask() {}
#endif
};

/// Calls body(i) for i in [0, n), in any order, on all threads; each call is one task.
template <typename Body>
void parallelFor(std::size_t n, const Body& body) {
    LoopOrder order;
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, n, 1),
        [&](const tbb::blocked_range<std::size_t>& range) {
            order.beginTask();
            for (std::size_t i = range.begin(); i != range.end(); ++i) body(i);
            order.endTask();
        },
        tbb::simple_partitioner());
}

/// Calls body(begin, end) on ranges of at most `grain` items that cover [0, n).
/// The bounds of the ranges are multiples of `grain`, whatever the number of threads.
template <typename Body>
void parallelRanges(std::size_t n, std::size_t grain, const Body& body) {
    const std::size_t n_ranges = (n + grain - 1) / grain;
    parallelFor(n_ranges, [&](std::size_t r) {
        body(r * grain, r * grain + grain < n ? r * grain + grain : n);
    });
}

/// One T per thread, made on first use; what it holds must not influence results.
template <typename T>
using PerThread = tbb::enumerable_thread_specific<T>;

/// Limits the number of threads while it lives; 0 means all cores.
class ThreadLimit {
public:
    explicit ThreadLimit(int threads) {
        if (threads > 0)
            control_ = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                             static_cast<std::size_t>(threads));
    }

private:
    std::unique_ptr<tbb::global_control> control_;
};

/// Number of threads that parallelFor may use now.
inline int threadCount() {
    return static_cast<int>(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
}

}  // namespace nerfvdb
