// SPDX-License-Identifier: Apache-2.0
// --split and --strict: which frames of a data set a command takes.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>

#include "trainer/dataset.h"

namespace nerfvdb {

class DatasetWords {
public:
    void add(CLI::App& command);
    Dataset read(const std::filesystem::path& path, DatasetOptions options, Report& report) const;

private:
    std::string split_ = "test";
    bool strict_ = false;
};

}  // namespace nerfvdb
