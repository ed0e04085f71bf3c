// SPDX-License-Identifier: Apache-2.0
#include <vtkFlyingEdges3D.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPolyData.h>
#include <vtkSmartPointer.h>

#include <algorithm>

#include "bench/mesh_peers.h"

namespace nerfvdb {

std::optional<MeshPeer> flyingEdgesPeer(const VoxelField& field, float iso) {
    const Topology& topology = field.topology();
    const Vec3i dims = topology.dims();
    const vtkSmartPointer<vtkImageData> image = vtkSmartPointer<vtkImageData>::New();
    image->SetDimensions(dims.x(), dims.y(), dims.z());
    image->AllocateScalars(VTK_FLOAT, 1);
    auto* const values = static_cast<float*>(image->GetScalarPointer());
    std::fill_n(values, dims.cast<std::size_t>().prod(), kEmptyRaw);
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        forEachBit(topology.voxels()[leaf], [&](int offset) {
            const Vec3i ijk =
                topology.leafCoords()[leaf] * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            values[(static_cast<std::size_t>(ijk.z()) * dims.y() + ijk.y()) * dims.x() + ijk.x()] =
                field.density()[leaf * kLeafVoxels + offset];
        });
    return MeshPeer{"VTK vtkFlyingEdges3D", [image, iso] {
                        vtkNew<vtkFlyingEdges3D> filter;
                        filter->SetInputData(image);
                        filter->SetValue(0, iso);
                        filter->ComputeNormalsOn();
                        filter->ComputeScalarsOff();
                        filter->Update();
                        vtkPolyData* const mesh = filter->GetOutput();
                        return PeerMesh{static_cast<std::size_t>(mesh->GetNumberOfPolys()),
                                        static_cast<std::size_t>(mesh->GetActualMemorySize()) * 1024};
                    }};
}

}  // namespace nerfvdb
