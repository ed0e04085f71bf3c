// SPDX-License-Identifier: Apache-2.0
// What COLMAP says while it works and what it leaves on disk, as far as a driver of it must know. Lines as of COLMAP
// 3.8 and, where they changed, of 3.13 (whose logger puts a prefix before them).
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace nerfvdb {

/// One thing that a line of output tells.
struct ColmapLine {
    enum class Kind {
        file_done,         // features of photograph `done` of `total`
        features,          // `done` of them, in the photograph before
        block_done,        // exhaustive matching, block `done` of `total`
        image_matched,     // sequential and spatial matching, photograph `done` of `total`
        model_begun,       // a new model, with its first two photographs
        image_registered,  // the model is about to have `done` photographs
    };
    Kind kind;
    std::int64_t done = 0, total = 0;
};

/// Nothing for lines that tell none of these.
std::optional<ColmapLine> parseColmapLine(std::string_view line);

/// The options of a sub-command by their full names, from its --help: "SiftExtraction.use_gpu", ...
std::vector<std::string> colmapOptions(const std::vector<std::string>& help);

/// A sparse model that COLMAP wrote.
struct ColmapModel {
    std::filesystem::path folder;
    std::vector<std::string> registered;  // names of photographs whose cameras it knows, sorted
    std::size_t points = 0;
};

/// The models in the sub-folders of a folder: those with the most photographs first (of equal ones, with more points).
/// Throws DataError for a file cut short.
std::vector<ColmapModel> listColmapModels(const std::filesystem::path& folder);

}  // namespace nerfvdb
