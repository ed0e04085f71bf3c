// SPDX-License-Identifier: Apache-2.0
// What to make pictures of: a model, or a plain volume, ours or another program's.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <string>

#include "vdb/renderer.h"
#include "vdb/volume_renderer.h"

namespace nerfvdb {

/// A loaded scene that renders itself.
class Scene {
public:
    virtual ~Scene() = default;
    virtual RenderedImage render(const Camera& camera) const = 0;
    virtual Vec3f background() const = 0;  // sRGB values
    /// Of the leaves that hold something, world units; of a scene without bounds its inner box.
    virtual Box occupiedBox() const = 0;
};

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
