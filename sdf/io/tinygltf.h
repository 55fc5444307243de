// tinygltf as the readers of glTF use it: without images, and in a namespace of its own, so that a program may hold
// another build of it; internal.
#pragma once

#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
#define tinygltf bilayer_tinygltf
#include <tiny_gltf.h>
