// SPDX-License-Identifier: Apache-2.0
// How fast the inner loops are, one by one, on every instruction set that this machine runs: simd/kernels.h on
// one thread.
#pragma once

#include "bench/plot.h"
#include "bench/result.h"
#include "core/report.h"

namespace nerfvdb {

struct KernelOptions {
    int repeats = 5;
    double min_sample_s = 0.05;
    int tiles = 256;       // of 256 rays, neighbours in a picture
    int resolution = 256;  // voxels along the scene's edge
    int channels = 8;
};

/// A series for each instruction set and one for the scalar reference, a row for each kernel. Columns: ns an
/// item (a sample, or what the label says), GB/s and GFLOP/s, by processor time, and times_floor: the time over what
/// the operations would take in registers alone, or the bytes in the nearest cache, whichever is more.
///
/// Bytes are those that an item reads and writes, each once, were nothing in a cache; operations are the
/// additions and multiplications of the formula, an exponential counting as ten. Both are nominal: ratios
/// between instruction sets and between runs are what the figures are for. The last row is a plain copy of 64
/// MiB, as a yardstick of memory. Scene: the procedural sphere's voxels, seen by a camera; the samples are
/// those of whole rays, the march the one to all of them.
BenchResult benchKernels(const KernelOptions& options, Report& report);

Plot kernelPlot(const BenchResult& result);

}  // namespace nerfvdb
