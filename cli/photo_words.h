// SPDX-License-Identifier: Apache-2.0
// --downscale, --alpha-masks, --no-alpha and --no-masks: what becomes of photographs before they are learned or scored.
#pragma once

#include <CLI/CLI.hpp>

#include "trainer/dataset.h"

namespace nerfvdb {

class PhotoWords {
public:
    void add(CLI::App& command);
    void apply(DatasetOptions& options) const;
    int downscale() const { return downscale_; }

private:
    int downscale_ = 1;
    bool alpha_masks_ = false, no_alpha_ = false, no_masks_ = false;
};

}  // namespace nerfvdb
