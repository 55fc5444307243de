// SPDX-License-Identifier: Apache-2.0
#include "integration/fluid/detail/liquid_copy.h"

#include <bilayer/sdf/grids.h>

#include <string>
#include <vector>

namespace bilayer::fluid::detail {

openvdb::FloatGrid::Ptr liquidCopy(const LevelSet& levelSet) {
    const openvdb::FloatGrid::Ptr liquid = levelSet.grids().distance->deepCopy();
    std::vector<std::string> names;
    for (auto entry = liquid->beginMeta(); entry != liquid->endMeta(); ++entry)
        if (entry->first.starts_with("bilayer:") && entry->first != metadata::origin) names.push_back(entry->first);
    for (const std::string& name : names) liquid->removeMeta(name);
    return liquid;
}

}  // namespace bilayer::fluid::detail
