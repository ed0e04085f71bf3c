// SPDX-License-Identifier: Apache-2.0
#include "trainer/object_box.h"

#include <cstdio>

#include "core/error.h"
#include "trainer/largest_pieces.h"
#include "trainer/scene_box.h"
#include "trainer/trainer.h"
#include "vdb/adapt.h"
#include "vdb/occupancy.h"

namespace nerfvdb {
namespace {

constexpr std::int64_t kSteps = 300;  // twice
constexpr float kMinAlpha = 0.01f;    // of a voxel
constexpr double kCrumb = 0.01;       // of the largest piece's cells: specks of fog, far out where few cameras look

/// How far the short training is, and whether to stop; what else it has to say is nobody's business.
class LookReport : public Report {
public:
    explicit LookReport(Report& report) : report_(report) {}
    void begin(const std::string&, std::int64_t total) override { report_.begin("looking for the object", total); }
    void update(std::int64_t done, const std::string&) override { report_.update(done, ""); }
    void end() override { report_.end(); }
    bool cancelled() const override { return report_.cancelled(); }

private:
    Report& report_;
};

}  // namespace

Box findObject(const Dataset& dataset, const Box& around, const TrainOptions& options, Report& report) {
    TrainOptions short_one;
    short_one.preset = Preset::fast;
    short_one.steps = {kSteps, kSteps};
    short_one.background = options.background;
    short_one.exposure = ExposureMode::off;
    short_one.extent = SceneExtent::box;
    short_one.bounds = around;
    short_one.max_memory_bytes = options.max_memory_bytes;
    short_one.seed = options.seed;
    LookReport progress(report);
    TrainResult found;
    try {
        found = train(dataset, short_one, progress, {});
    } catch (const NumericError&) {
        return around;  // all of it became transparent
    }
    if (found.interrupted) throw Interrupted("stopped while looking for the object; this training has left no model");
    const VoxelField& field = found.model.field;
    const std::vector<LeafMask> dense = findOccupied(field, kMinAlpha).cells;
    const Topology object = prune(field.topology(), largestPieces(field.topology(), dense, kCrumb));
    if (!found.numeric_error.empty() || object.cellCount() == 0) return around;
    const Box seen = boundsOfCells(field.frame(), object);
    const Box box{seen.min.cwiseMax(around.min), seen.max.cwiseMin(around.max)};
    char text[200];
    std::snprintf(text, sizeof text,
                  "an object before a plain background, in %.4g, %.4g, %.4g to %.4g, %.4g, %.4g (--bounds or --scene open say "
                  "otherwise)",
                  box.min.x(), box.min.y(), box.min.z(), box.max.x(), box.max.y(), box.max.z());
    report.info(text);
    return box;
}

}  // namespace nerfvdb
