// SPDX-License-Identifier: Apache-2.0
// How many shells of an open scene leave as one box.
#pragma once

#include <CLI/CLI.hpp>

#include "core/report.h"
#include "vdb/model.h"

namespace nerfvdb {

class ShellWords {
public:
    /// --shells.
    void add(CLI::App& command);
    bool isGiven() const { return shells_ > 0; }
    /// How many of a model's shells are asked for; `otherwise` where nobody said. Throws UsageError for more than it has.
    int count(const Model& model, int otherwise) const;
    /// The inner ones as one box, one where nobody said; tells how many that are. Throws UsageError as flatModel.
    Model flatten(const Model& model, Report& report) const;

private:
    int shells_ = 0;
};

}  // namespace nerfvdb
