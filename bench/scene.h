// SPDX-License-Identifier: Apache-2.0
// What benchmarks look at: scenes to learn, from disk or made by formula, and a trained model with photographs.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "trainer/dataset.h"
#include "trainer/write_dataset.h"
#include "vdb/model.h"

namespace nerfvdb {

/// A scene that can be loaded as often as asked; loading belongs to what a user waits for.
struct BenchScene {
    std::string name;
    std::function<Dataset(Split, Report&)> load;
};

/// A data set on disk; named by its folder.
BenchScene sceneOnDisk(const std::filesystem::path& path);

/// A procedural scene (synthetic_scene.h), photographed here and now and kept in memory; loading it is a copy.
BenchScene proceduralScene(const std::string& name, const SyntheticDatasetOptions& options, Report& report);

/// Keeps at most `n` views, evenly spread over the data set's order; 0 keeps all.
void limitViews(Dataset& dataset, int n);

/// A model with views to train on and views to be judged by.
struct Subject {
    std::string name;
    Model model;
    Dataset train, test;
};

struct SubjectOptions {
    std::filesystem::path model = {};  // empty: the scene is learned first ...
    std::filesystem::path data = {};   // ... from here; empty: from a procedural scene
    std::string procedural = "demo";
    SyntheticDatasetOptions pictures = {};  // of the procedural scene
    double learn_seconds = 60;
    int test_views = 4;
};

/// Learns a scene for options.learn_seconds.
Subject learnSubject(const BenchScene& scene, const SubjectOptions& options, Report& report);

/// Loads or makes what the options name. A model without data is judged by pictures of itself from a circle of
/// cameras, made with nothing skipped; its error is then the error of skipping alone.
Subject makeSubject(const SubjectOptions& options, Report& report);

}  // namespace nerfvdb
