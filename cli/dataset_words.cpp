// SPDX-License-Identifier: Apache-2.0
#include "cli/dataset_words.h"

#include <map>

namespace nerfvdb {

void DatasetWords::add(CLI::App& command) {
    command.add_option("--split", split_, "Which frames: train, val or test [test]")
        ->check(CLI::IsMember({"train", "val", "test"}))
        ->type_name("NAME");
    command.add_flag("--strict", strict_, "A frame without its image is an error, not a warning");
}

Dataset DatasetWords::read(const std::filesystem::path& path, bool load_photos, Report& report) const {
    static const std::map<std::string, Split> kSplits = {
        {"train", Split::train}, {"val", Split::val}, {"test", Split::test}};
    return readDataset(path, kSplits.at(split_), {.strict = strict_, .load_photos = load_photos}, report);
}

}  // namespace nerfvdb
