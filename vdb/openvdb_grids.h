// SPDX-License-Identifier: Apache-2.0
// OpenVDB's header with the kinds of grid that nerfvdb works on, whose hundreds of member functions are compiled once
// (openvdb_grids.cpp) and not in every file that names one: half of such a file's time in the compiler.
// Included only by .cpp files that work on grids.
#pragma once

#include <openvdb/openvdb.h>

// Nodes are left to the compiler: OpenVDB 10 has members of them that do not compile (RootNode::NodeStruct).
extern template class openvdb::tree::Tree<openvdb::FloatTree::RootNodeType>;
extern template class openvdb::tree::Tree<openvdb::Vec3STree::RootNodeType>;
extern template class openvdb::Grid<openvdb::FloatTree>;
extern template class openvdb::Grid<openvdb::Vec3STree>;
