// SPDX-License-Identifier: Apache-2.0
// All numbers that are taken from the paper, and nothing else. Y. Wu, J. Man, Z. Xie, "A double layer method for
// constructing signed distance fields from triangle meshes", Graphical Models 76 (2014) 214-223. In the paper K is 1024
// triangles.
#pragma once

#include <array>
#include <glm/vec3.hpp>
#include <optional>

namespace bilayer::paper::published {

inline constexpr const char* processor = "Xeon E5-2630";
inline constexpr const char* gpu = "Tesla C2075";

/// Table 1, the bunny against AWPN.
struct Error {
    int nodes;    ///< along each side
    double step;  ///< as printed
    double worst, mean;
};
inline constexpr std::array<Error, 4> table1{{{72, 0.06, 0.04923, 0.02701},
                                              {126, 0.04, 0.03911, 0.01838},
                                              {251, 0.02, 0.02100, 0.00816},
                                              {501, 0.01, 0.01202, 0.00427}}};

/// Tables 2, 3 and 5: nodes along each side.
inline constexpr int tableNodes = 251;

/// Tables 2 and 3 [s].
struct Seconds {
    const char* model;
    double triangles;  ///< [K]
    double awpn, serial, prism, opencl;
};
inline constexpr std::array<Seconds, 3> tables23{{{"bunny", 68.91, 0.62, 0.68, 0.13, 0.11},
                                                  {"dragon", 850.88, 3.60, 1.59, 0.37, 0.21},
                                                  {"circular box", 1369.77, 4.56, 2.44, 0.43, 0.14}}};

/// Table 4, the circular box: serial, Tesla, OpenCL on the CPU [s]. None: out of memory.
struct Growth {
    std::array<int, 3> nodes;
    double serial;
    std::optional<double> tesla;
    double opencl;
};
inline constexpr std::array<Growth, 7> table4{{{{251, 251, 251}, 2.44, 0.08, 0.14},
                                               {{501, 501, 501}, 4.67, 0.27, 0.29},
                                               {{715, 715, 715}, 10.53, 0.59, 0.63},
                                               {{715, 834, 715}, 14.80, 0.85, 0.74},
                                               {{715, 1001, 715}, 22.16, 1.65, 1.05},
                                               {{715, 1251, 715}, 41.47, std::nullopt, 1.38},
                                               {{715, 1667, 715}, 110.37, std::nullopt, 2.50}}};

/// Table 5, the sphere of 3.21 K triangles, OpenCL on the CPU.
struct Uneven {
    double variance;  ///< of areas, Eq. 5
    double seconds;
};
inline constexpr std::array<Uneven, 3> table5{{{0.0013, 0.07}, {0.0052, 0.19}, {0.0098, 0.53}}};
inline constexpr double sphereTriangles = 3.21;  ///< [K]

/// Grids of Fig. 7, deltas of Fig. 8 [steps], the grid of Figs. 9 and 10.
inline constexpr std::array<int, 3> figure7{72, 126, 251};
inline constexpr std::array<float, 3> figure8{0.1f, 0.5f, 1.f};
inline const glm::ivec3 largeGrid(715, 834, 715);

/// Triangle counts of the originals and of the surfaces extracted from their fields, Figs. 9 to 11 [K].
struct Surface {
    const char* model;
    double original, result;
};
inline constexpr std::array<Surface, 3> surfaces{
    {{"dragon", 850.88, 1902.90}, {"circular box", 1369.77, 3975.68}, {"screwdriver", 53.03, 37.57}}};

inline constexpr double thousand = 1024;  ///< triangles in one K

}  // namespace bilayer::paper::published
