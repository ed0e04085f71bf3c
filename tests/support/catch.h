// SPDX-License-Identifier: Apache-2.0
// The one place that names Catch2's header (version 2 now).
#pragma once

#include <catch2/catch.hpp>
