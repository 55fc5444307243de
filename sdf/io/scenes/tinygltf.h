// SPDX-License-Identifier: Apache-2.0
// tinygltf as the glTF readers use it: without images, and in its own namespace, so that a program may contain another
// build of it; internal.
// Tested by tests/sdf/read_gltf.cpp through readScene().
#pragma once

#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
#define tinygltf bilayer_tinygltf
#include <tiny_gltf.h>
