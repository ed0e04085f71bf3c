// SPDX-License-Identifier: Apache-2.0
#include "cli/train_blocks.h"

#include "cli/output_path.h"
#include "cli/process.h"
#include "cli/text.h"
#include "core/error.h"
#include "trainer/block_index.h"
#include "trainer/block_plan.h"

namespace nerfvdb {
namespace {

/// `has_alpha`: of the whole scene; a block of it whose photographs are opaque is learned no differently.
BlockIndex planIndex(const TrainRun& run, const BlockCount& count, Report& report, bool& has_alpha) {
    DatasetOptions cameras = run.photographs;
    cameras.load_photos = false;
    const Dataset dataset = readDataset(run.data, Split::train, cameras, report);
    BlockIndex index;
    index.grid = planBlocks(dataset, count.columns, count.rows, run.options.bounds);
    index.views = viewsOfBlocks(index.grid, dataset);
    has_alpha = !run.photographs.alpha_masks && !run.photographs.no_alpha && isTransparent(dataset, dataset.views.size());
    return index;
}

/// The training of one block. `rest_of_views`: of this block and those that are still to come.
TrainRun blockRun(const TrainRun& run, const BlockGrid& grid, const BlockId& block, std::size_t views,
                  std::size_t rest_of_views) {
    TrainRun part = run;
    part.out = blockPath(run.out, block);
    part.photographs.choose = [grid, block](const Camera& camera) { return grid.takesCameraAt(block, camera.position); };
    part.options.extent = SceneExtent::open;
    part.options.bounds = grid.box(block);
    part.resume = run.resume && std::filesystem::exists(besideModel(part.out, ".ckpt"));
    if (run.options.time_s) {
        const double now = secondsSinceProcessStart();
        part.options.time_s = now + (*run.options.time_s - now) * static_cast<double>(views) / static_cast<double>(rest_of_views);
    }
    return part;
}

bool isDone(const std::filesystem::path& model) {
    return std::filesystem::exists(model) && !std::filesystem::exists(besideModel(model, ".ckpt"));
}

/// Blocks to train, in order.
std::vector<BlockId> chooseBlocks(const TrainRun& run, const BlockIndex& index, const std::optional<BlockId>& only,
                                  Report& report) {
    const BlockGrid& grid = index.grid;
    if (only) {
        if (!grid.has(*only))
            throw UsageError("--block", blockName(*only),
                             "0,0 to " + blockName({grid.columns - 1, grid.rows - 1}));
        if (!index.isTrained(*only))
            throw DataError("--block " + blockName(*only), "fewer than three photographs taken there", "a block with more",
                            "'nerfvdb info " + run.out.string() + "' lists the blocks");
        return {*only};
    }
    std::vector<BlockId> chosen, left_out;
    for (const BlockId& block : grid.blocks()) {
        if (!index.isTrained(block))
            left_out.push_back(block);
        else if (run.resume && isDone(blockPath(run.out, block)))
            report.info("block " + blockName(block) + " is there already");
        else
            chosen.push_back(block);
    }
    const std::size_t n_all = grid.blocks().size();
    if (left_out.size() == n_all)
        throw UsageError("--blocks", std::to_string(grid.columns) + "x" + std::to_string(grid.rows) +
                                         ", none with three photographs",
                         "fewer blocks, or more photographs");
    if (!left_out.empty())
        report.warn(std::to_string(left_out.size()) + " of " + std::to_string(n_all) + " blocks are left out (first: " +
                    blockName(left_out.front()) + "): fewer than three photographs were taken there");
    return chosen;
}

}  // namespace

TrainOutcome trainBlocks(const TrainRun& run, const BlockCount& count, const std::optional<BlockId>& only,
                         Report& report) {
    prepareOutputFolder("--out", run.out);
    TrainRun whole = run;
    const BlockIndex index = planIndex(run, count, report, whole.photographs.has_alpha);
    const BlockGrid& grid = index.grid;
    const std::vector<BlockId> blocks = chooseBlocks(run, index, only, report);
    writeBlockIndex(run.out, index);

    const auto viewsOf = [&](const BlockId& block) {
        return index.views[static_cast<std::size_t>(block.i * grid.rows + block.j)];
    };
    std::size_t rest = 0;
    for (const BlockId& block : blocks) rest += viewsOf(block);

    TrainOutcome all;
    all.json = {{"command", "train"}, {"blocks", {grid.columns, grid.rows}}, {"trained", Json::array()}};
    for (const BlockId& block : blocks) {
        const TrainRun part = blockRun(whole, grid, block, viewsOf(block), rest);
        rest -= viewsOf(block);
        report.info(formatted("block %s of %dx%d", blockName(block).c_str(), grid.columns, grid.rows));
        checkOutputs(part);
        TrainOutcome outcome = trainToFiles(part, report);
        all.text += outcome.text;
        all.json["trained"].push_back({{"block", {block.i, block.j}}});
        all.json["trained"].back().update(outcome.json);
        if (!outcome.isWhole()) {
            all.stopped = outcome.stopped;
            all.numeric_error = outcome.numeric_error;
            all.checkpoint_error = outcome.checkpoint_error;
            break;
        }
        std::filesystem::remove(besideModel(part.out, ".ckpt"));
    }
    all.json["peak_memory_bytes"] = peakMemoryBytes();
    all.text += formatted("%s: %zu of %zu blocks trained\n", run.out.c_str(), all.json["trained"].size(),
                          grid.blocks().size());
    return all;
}

}  // namespace nerfvdb
