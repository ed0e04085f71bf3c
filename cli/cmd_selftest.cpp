// SPDX-License-Identifier: Apache-2.0
// nerfvdb selftest: does this program keep its numerical promises on this machine?
#include "bench/stress.h"
#include "cli/commands.h"
#include "cli/stress_words.h"
#include "core/error.h"

namespace nerfvdb {
namespace {

void runSelftest(const SharedOptions& shared) {
    const auto limit = shared.begin();
    TerminalReport report;
    const StressResult result = runStress({}, report);
    report.end();
    shared.finish(stressJson("selftest", result), stressSummary(result));
    refuseFailures(result);
}

}  // namespace

Command addSelftest(CLI::App& program) {
    auto shared = std::make_shared<SharedOptions>();
    CLI::App& app = *program.add_subcommand(
        "selftest", "Hold this program's numbers against exact ones, on this machine; under a minute");
    shared->add(app,
                "  nerfvdb selftest --json selftest.json\n"
                "\nExit code 1 if a promise is broken. The long form: nerfvdb bench stress.");
    return {&app, [shared] { runSelftest(*shared); }};
}

}  // namespace nerfvdb
