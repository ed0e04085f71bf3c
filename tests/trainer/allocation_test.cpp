// SPDX-License-Identifier: Apache-2.0
// A training step takes no memory for its rays: once its buffers have grown, thousands of rays more cost no allocation.
#include <atomic>
#include <cstdlib>
#include <new>

#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/grid_field.h"
#include "tests/support/sphere_dataset.h"
#include "trainer/possible_cells.h"
#include "trainer/train_step.h"

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // which bring operators of their own

using namespace nerfvdb;

namespace {

std::atomic<std::size_t> allocations{0};

void* counted(std::size_t size, std::size_t alignment) {
    allocations.fetch_add(1, std::memory_order_relaxed);
    const std::size_t whole = (size + alignment - 1) / alignment * alignment;
    if (void* const memory = std::aligned_alloc(alignment, whole > 0 ? whole : alignment)) return memory;
    throw std::bad_alloc();
}

/// Allocations of a step of so many rays, after as many steps as it takes for buffers to have grown.
std::size_t allocationsOfStep(int batch) {
    static const Dataset dataset = test::sphereDataset(Split::train, 12, 48);
    const BoxGrid grid = gridOver({Vec3d::Constant(-0.9), Vec3d::Constant(0.9)}, 32);
    TrainState state;
    state.decoder = Decoder(8, 3);
    state.field = VoxelField(Topology(grid.dims, possibleCells(dataset, grid, 2)), grid.frame, 8, 140.0);
    test::setDensity(state.field, [](const Vec3i&) { return -3.0f; });
    state.density_moment = HugeArray<float>(state.field.density().size());
    state.feature_moment = HugeArray<float>(state.field.density().size());
    state.seen.assign(state.field.topology().leafCount(), {});
    state.occupancy = findOccupied(state.field, 0.01f);
    RaySource source(dataset, 11);
    source.update(state.field, state.occupancy);
    TrainStepper stepper;
    // The same rays again: nothing can need more than it did.
    for (int i = 0; i < 3; ++i) stepper.step(state, source, 0, batch, {}, {});
    const std::size_t before = allocations;
    stepper.step(state, source, 0, batch, {}, {});
    return allocations - before;
}

}  // namespace

#define NERFVDB_COUNTED [[gnu::noinline]]  // inlined, GCC takes new and free, or malloc and delete, for a mistake

NERFVDB_COUNTED void* operator new(std::size_t size) { return counted(size, alignof(std::max_align_t)); }
NERFVDB_COUNTED void* operator new[](std::size_t size) { return counted(size, alignof(std::max_align_t)); }
NERFVDB_COUNTED void* operator new(std::size_t size, std::align_val_t alignment) { return counted(size, static_cast<std::size_t>(alignment)); }
NERFVDB_COUNTED void* operator new[](std::size_t size, std::align_val_t alignment) { return counted(size, static_cast<std::size_t>(alignment)); }
NERFVDB_COUNTED void operator delete(void* memory) noexcept { std::free(memory); }
NERFVDB_COUNTED void operator delete[](void* memory) noexcept { std::free(memory); }
NERFVDB_COUNTED void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
NERFVDB_COUNTED void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
NERFVDB_COUNTED void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
NERFVDB_COUNTED void operator delete[](void* memory, std::align_val_t) noexcept { std::free(memory); }
NERFVDB_COUNTED void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
NERFVDB_COUNTED void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

TEST_CASE("a step allocates nothing for its rays") {
    const ThreadLimit one(1);  // tiles go to whoever is free: on several threads buffers grow when they meet a larger one
    const std::size_t few = allocationsOfStep(512), many = allocationsOfStep(8192);
    INFO(few << " allocations with 512 rays, " << many << " with 8192");
    CHECK(many <= few);
}

#endif
