// SPDX-License-Identifier: Apache-2.0
// The slow way to a derivative, for judging the fast one.
#pragma once

namespace nerfvdb::test {

/// (loss(variable + step) - loss(variable - step)) / (2 step), in double; `variable` is restored.
template <typename Loss>
double centralDifference(const Loss& loss, double& variable, double step) {
    const double before = variable;
    variable = before + step;
    const double up = loss();
    variable = before - step;
    const double down = loss();
    variable = before;
    return (up - down) / (2 * step);
}

}  // namespace nerfvdb::test
