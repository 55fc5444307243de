// SPDX-License-Identifier: Apache-2.0
#include "tools/tiles/sign_records.h"

#include <string>

#include "sdf/base/method_names.h"

namespace bilayer::tools {

using namespace bilayer::detail;
namespace {

const char* checkName(NormalsCheck check) {
    return check == NormalsCheck::none ? "none" : check == NormalsCheck::count ? "count" : "correct";
}

NormalsCheck checkOf(const std::string& name) {
    return name == "count" ? NormalsCheck::count : name == "correct" ? NormalsCheck::correct : NormalsCheck::none;
}

Json repairJson(const SignRepair& repair) {
    return {{"wrong", repair.repaired}, {"contradictory", repair.refused}};
}

SignRepair repairOf(const Json& json) {
    return {json.at("wrong").get<std::size_t>(), json.at("contradictory").get<std::size_t>()};
}

}  // namespace

Json toJson(const PlannedSigns& planned) {
    const PartSigns& signs = planned.signs;
    return {{"method", detail::nameOf(signs.method)},
            {"reason", signs.reason},
            {"check", checkName(signs.check)},
            {"name", signs.name.empty() ? detail::nameOf(signs.method) : signs.name},
            {"round", planned.round}};
}

PlannedSigns plannedSigns(const Json& json) {
    PlannedSigns planned;
    if (json.is_null()) return planned;
    const auto method = json.at("method").get<std::string>();
    for (const Sign sign : {Sign::winding, Sign::flood})
        if (method == detail::nameOf(sign)) planned.signs.method = sign;
    planned.signs.reason = json.at("reason").get<std::string>();
    planned.signs.check = checkOf(json.at("check").get<std::string>());
    planned.signs.name = json.at("name").get<std::string>();
    planned.round = json.at("round").get<int>();
    return planned;
}

Json toJson(const SignCounts& counts) {
    return {{"conflicts", counts.conflicts},
            {"leaves", counts.compared.leaves},
            {"everyFifthColumn", repairJson(counts.compared.everyFifth)},
            {"allColumns", repairJson(counts.compared.all)}};
}

SignCounts signCounts(const Json& json) {
    return {
        json.at("conflicts").get<std::size_t>(),
        {json.at("leaves").get<std::size_t>(), repairOf(json.at("everyFifthColumn")), repairOf(json.at("allColumns"))}};
}

}  // namespace bilayer::tools
