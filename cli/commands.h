// SPDX-License-Identifier: Apache-2.0
// The sub-commands: each adds itself to the program's words and hands back what to do when it is called.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>

#include "cli/json_output.h"
#include "cli/terminal_report.h"
#include "cli/text.h"
#include "core/parallel.h"

namespace nerfvdb {

struct Command {
    CLI::App* words;            // its options and help
    std::function<void()> run;  // after parsing; throws Error
};

Command addTrain(CLI::App& program);     // photographs -> model.vdb, model.ckpt, model.csv
Command addEval(CLI::App& program);      // model + photographs -> scores
Command addRender(CLI::App& program);    // model + cameras -> pictures
Command addExport(CLI::App& program);    // model -> .vdb for other programs
Command addMesh(CLI::App& program);      // model -> .ply, .obj, .glb, .stl
Command addInfo(CLI::App& program);      // what a model, a volume or a data set holds
Command addBench(CLI::App& program);     // speed and quality, measured and compared
Command addSelftest(CLI::App& program);  // numbers held against exact ones
Command addSynth(CLI::App& program);     // procedural scene -> data set with exact truth
Command addPrepare(CLI::App& program);   // photographs without poses -> data set
Command addReadVdb(CLI::App& program);   // for this program's own use (foreign_vdb.h)

/// --threads, --simd, --json and --version, which every command has.
class SharedOptions {
public:
    /// Adds the options to a command, and the example to the end of its help.
    void add(CLI::App& command, const std::string& example);

    /// Before work: checks --json, chooses the instruction set, and limits the threads while the result lives.
    std::unique_ptr<ThreadLimit> begin() const;

    /// After work: writes --json; `text` goes to standard output unless the JSON went there.
    void finish(const Json& json, const std::string& text) const;

private:
    int threads_ = 0;
    std::string simd_;
    std::string json_;
};

}  // namespace nerfvdb
