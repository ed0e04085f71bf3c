// SPDX-License-Identifier: Apache-2.0
#include "cli/shell_words.h"

#include "cli/text.h"
#include "core/error.h"
#include "export/flat_model.h"

namespace nerfvdb {

void ShellWords::add(CLI::App& command) {
    command
        .add_option("--shells", shells_,
                    "Of a scene without bounds the inner N shells, merged in the finest one's voxels [1]")
        ->check(CLI::Range(1, kMaxShells))
        ->type_name("N");
}

int ShellWords::count(const Model& model, int otherwise) const {
    const int available = model.field.shells().count;
    if (shells_ > available)
        throw UsageError("--shells", std::to_string(shells_), "1 to " + std::to_string(available),
                         "'nerfvdb info' lists the shells of a model");
    return shells_ > 0 ? shells_ : otherwise;
}

Model ShellWords::flatten(const Model& model, Report& report) const {
    const int available = model.field.shells().count, shells = count(model, 1);
    if (shells < available)
        report.info(formatted("the inner %d of %d shells, without the sky; --shells N for more", shells, available));
    return flatModel(model, shells);
}

}  // namespace nerfvdb
