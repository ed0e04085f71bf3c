// SPDX-License-Identifier: Apache-2.0
#include "bench/stress.h"

#include <algorithm>
#include <cmath>

#include "bench/number_text.h"
#include "bench/stopwatch.h"
#include "bench/stress_decoder.h"
#include "bench/stress_kernels.h"
#include "bench/stress_rays.h"
#include "bench/stress_skips.h"
#include "bench/stress_training.h"
#include "core/simd/kernels.h"

namespace nerfvdb {
namespace {

constexpr std::int64_t kShortSteps = 40, kLongSteps = kEnoughSteps;  // of a training on hard input
constexpr int kShortScenes = 30, kLongScenes = 500;         // that try to break the bound of skipping

/// Rays on every instruction set; the areas are told apart by its name.
std::vector<StressRow> raysOnEveryTarget(Report& report) {
    const simd::KeepTarget keep;
    std::vector<StressRow> all;
    for (const std::string& target : simd::supportedTargets()) {
        simd::forceTarget(target);
        const bool is_best = target == simd::supportedTargets().front();
        for (StressRow row : stressRays({.is_long = is_best}, report)) {
            row.area += ", " + target;
            all.push_back(row);
        }
    }
    return all;
}

}  // namespace

StressResult runStress(const StressOptions& options, Report& report) {
    Stopwatch clock;
    clock.start();
    StressResult result;
    result.facts = gatherFacts();
    const auto add = [&](const std::vector<StressRow>& rows) {
        result.rows.insert(result.rows.end(), rows.begin(), rows.end());
    };
    add(options.is_long ? raysOnEveryTarget(report) : stressRays({}, report));
    add(stressDecoder(report));
    add(stressKernels(report));
    add(stressSkips({.scenes = options.is_long ? kLongScenes : kShortScenes}, report));
    add(stressDeterminism(report));
    const std::filesystem::path scratch =
        options.scratch.empty() ? std::filesystem::temp_directory_path() : options.scratch;
    add(stressInput(scratch, options.is_long ? kLongSteps : kShortSteps, report));
    if (options.is_long && options.seeds > 0) add(stressSeeds({.seeds = options.seeds}, report));
    result.seconds = clock.wallSeconds();
    return result;
}

std::string stressDocument(const StressResult& result, const BenchResult& curves) {
    std::uint64_t cases = 0, failed = 0;
    for (const StressRow& row : result.rows) cases += row.cases, failed += row.failed;
    std::string text = std::to_string(result.rows.size()) + " rows, " + std::to_string(cases) + " cases, " +
                       std::to_string(failed) + " beyond their bound; " + factsLine(result.facts) + "\n\n" +
                       stressMarkdown(result.rows);
    text += "\n### error against time\n\n" + curves.title +
            ", levels of 8 bits.\n\n| Knob | Value | Microseconds a ray | Samples a ray |"
            " With features | Largest error | Mean error | Bound |\n|---|---|---|---|---|---|---|---|\n";
    const auto cell = [&](const BenchRow& row, const char* column) {
        const double value = curves.median(row, column);
        return std::isnan(value) ? std::string("-") : numberText(value);
    };
    for (const BenchRow& row : curves.rows) {
        text += "| " + row.series + " | " + row.label;
        for (const char* column :
             {"microseconds", "density_samples", "feature_samples", "largest_error", "mean_error", "bound"})
            text += " | " + cell(row, column);
        text += " |\n";
    }
    text += "\n";
    for (const auto& [name, value] : curves.figures) text += "- " + name + ": " + numberText(value) + "\n";
    for (const std::string& note : curves.notes) text += "- " + note + "\n";
    return text;
}

}  // namespace nerfvdb
