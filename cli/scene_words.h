// SPDX-License-Identifier: Apache-2.0
// What to make pictures of: a model, a folder of blocks, or a plain volume, ours or another program's.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <string>

#include "cli/scene.h"

namespace nerfvdb {

/// The words that name a scene.
class SceneWords {
public:
    /// MODEL, --background, --no-view-dependence.
    void add(CLI::App& command);
    const std::string& path() const { return path_; }
    /// Throws IoError, DataError, UsageError.
    std::unique_ptr<Scene> load(bool normals) const;

private:
    std::string path_, background_;
    bool no_view_dependence_ = false;
};

}  // namespace nerfvdb
