// SPDX-License-Identifier: Apache-2.0
// nerfvdb: words in, exit code out. The one place that turns exceptions into exit codes:
//   0 done   1 failed   2 wrong usage   130 interrupted, after saving
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <iostream>
#include <new>
#include <sstream>

#include "cli/commands.h"
#include "cli/process.h"
#include "core/error.h"

namespace {

using namespace nerfvdb;

enum ExitCode { kDone = 0, kFailed = 1, kWrongUsage = 2, kInterrupted = 130 };

int complain(ExitCode code, const std::string& message) {
    std::cerr << "nerfvdb: " << printable(message) << std::endl;
    return code;
}

/// What CLI11 says of words that it does not understand, which it quotes.
std::string wrongWords(const CLI::App* program, const CLI::Error& error) {
    std::istringstream lines(CLI::FailureMessage::simple(program, error));
    std::string text;
    for (std::string line; std::getline(lines, line);) text += printable(line) + "\n";
    return text;
}

/// Without allocating anything.
int complainOfMemory(const std::bad_alloc& error) {
    const bool says_more = std::strcmp(error.what(), std::bad_alloc().what()) != 0;
    std::cerr << "nerfvdb: out of memory" << (says_more ? ": " : "") << (says_more ? error.what() : "")
              << "; close other programs, or train with a smaller --max-memory" << std::endl;
    return kFailed;
}

/// An exception where none can pass, as in a thread that a library starts.
[[noreturn]] void endAtOnce() {
    ExitCode code = kFailed;
    try {
        if (const std::exception_ptr error = std::current_exception()) std::rethrow_exception(error);
    } catch (const std::bad_alloc& error) {
        complainOfMemory(error);
    } catch (const std::exception& error) {
        complain(code, error.what());
    } catch (...) {
        complain(code, "an unknown error");
    }
    std::_Exit(code);
}

int runProgram(int argc, char** argv) {
    CLI::App program("Sparse radiance fields on OpenVDB: photographs in, volumes and meshes out.", "nerfvdb");
    program.set_version_flag("--version", "nerfvdb " NERFVDB_VERSION);
    program.require_subcommand(1);
    program.failure_message(wrongWords);
    program.footer(
        "Example:\n  nerfvdb train photos/ --out model.vdb && nerfvdb export model.vdb --out volume.vdb\n"
        "\n'nerfvdb COMMAND --help' tells more.");
    const Command commands[] = {addTrain(program),   addEval(program),  addRender(program), addExport(program),
                                addMesh(program),    addInfo(program),  addPrepare(program), addSynth(program),
                                addBench(program),   addSelftest(program), addReadVdb(program)};
    try {
        program.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        // Of an unknown word CLI11 says only that a sub-command is required.
        const std::vector<std::string> words = program.remaining();
        if (error.get_name() == "RequiredError" && program.get_subcommands().empty() && !words.empty())
            throw UsageError("command", "'" + words.front() + "'", "one that 'nerfvdb --help' lists");
        return program.exit(error) == 0 ? kDone : kWrongUsage;  // --help and --version arrive here too
    }
    catchInterrupts();
    for (const Command& command : commands)
        if (command.words->parsed()) command.run();
    return kDone;
}

}  // namespace

int main(int argc, char** argv) {
    std::set_terminate(endAtOnce);
    giveBackFreedMemory();
    std::signal(SIGXFSZ, SIG_IGN);  // writing past the largest file allowed then fails as on a full disk
    try {
        return runProgram(argc, argv);
    } catch (const Interrupted& error) {
        return complain(kInterrupted, error.what());
    } catch (const UsageError& error) {
        return complain(kWrongUsage, error.what());
    } catch (const std::bad_alloc& error) {
        return complainOfMemory(error);
    } catch (const std::exception& error) {
        return complain(kFailed, error.what());
    }
}
