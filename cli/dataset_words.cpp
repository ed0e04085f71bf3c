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

Dataset DatasetWords::read(const std::filesystem::path& path, DatasetOptions options, Report& report) const {
    static const std::map<std::string, Split> kSplits = {
        {"train", Split::train}, {"val", Split::val}, {"test", Split::test}};
    options.strict = strict_;
    return readDataset(path, kSplits.at(split_), options, report);
}

}  // namespace nerfvdb
