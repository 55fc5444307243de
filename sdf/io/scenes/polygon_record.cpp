// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/scenes/polygon_record.h"

#include <algorithm>
#include <cstdint>
#include <new>
#include <numeric>

#include "sdf/base/quoted_text.h"

namespace bilayer::detail {
namespace {

constexpr std::uint64_t maxNotes = 1000;       // further notes on a file are not sent
constexpr std::uint64_t maxTextBytes = 10000;  // of a note, of an error

enum Answer : std::uint64_t { ofPolygons, ofError, ofExhaustedMemory };

struct RecordHeader {
    std::uint64_t answer, points, corners, sizes, notes;
};

void sendText(const ChildProcess::Send& send, const std::string& text) {
    const std::uint64_t count = std::min<std::uint64_t>(text.size(), maxTextBytes);
    send(&count, sizeof count);
    send(text.data(), count);
}

std::string receiveText(const ChildProcess::Receive& receive) {
    std::uint64_t count = 0;
    receive(&count, sizeof count);
    if (count > maxTextBytes) throw ChildFailure("gave a damaged answer");
    std::string text(count, ' ');
    receive(text.data(), count);
    return oneLine(text);
}

template <class T>
void receiveAll(const ChildProcess::Receive& receive, std::vector<T>& items, std::uint64_t count) {
    items.resize(count);
    receive(items.data(), count * sizeof(T));
}

bool fits(const RecordHeader& header, std::size_t byteLimit) {
    constexpr std::uint64_t maxCount = std::uint64_t(1) << 40;  // larger counts could overflow the sum
    return header.notes <= maxNotes && std::max({header.points, header.corners, header.sizes}) <= maxCount &&
           header.points * sizeof(glm::dvec3) + (header.corners + header.sizes) * sizeof(unsigned) <= byteLimit;
}

bool consistent(const Polygons& p) {
    const auto isPoint = [&](unsigned corner) { return corner < p.points.size(); };
    if (!std::all_of(p.corners.begin(), p.corners.end(), isPoint)) return false;
    if (p.sizes.empty()) return p.corners.size() % 3 == 0;
    const auto isFace = [](unsigned size) { return size >= 3; };
    return std::all_of(p.sizes.begin(), p.sizes.end(), isFace) &&
           std::accumulate(p.sizes.begin(), p.sizes.end(), std::uint64_t(0)) == p.corners.size();
}

}  // namespace

void sendPolygons(const ChildProcess::Send& send, const Polygons& p) {
    const RecordHeader header{ofPolygons, p.points.size(), p.corners.size(), p.sizes.size(),
                              std::min<std::uint64_t>(p.notes.size(), maxNotes)};
    send(&header, sizeof header);
    send(p.points.data(), p.points.size() * sizeof(glm::dvec3));
    send(p.corners.data(), p.corners.size() * sizeof(unsigned));
    send(p.sizes.data(), p.sizes.size() * sizeof(unsigned));
    for (std::size_t i = 0; i < header.notes; ++i) sendText(send, p.notes[i]);
}

void sendError(const ChildProcess::Send& send, const std::string& text) {
    const RecordHeader header{ofError, 0, 0, 0, 0};
    send(&header, sizeof header);
    sendText(send, text);
}

void sendOutOfMemory(const ChildProcess::Send& send) {
    const RecordHeader header{ofExhaustedMemory, 0, 0, 0, 0};
    send(&header, sizeof header);
}

Polygons receivePolygons(const ChildProcess::Receive& receive, std::size_t byteLimit) {
    RecordHeader header{};
    receive(&header, sizeof header);
    if (header.answer == ofError) {
        const std::string why = receiveText(receive);
        throw std::runtime_error(why.empty() ? "cannot be read" : why);
    }
    if (header.answer == ofExhaustedMemory) throw std::bad_alloc();
    if (header.answer != ofPolygons || !fits(header, byteLimit)) throw ChildFailure("gave a damaged answer");
    Polygons polygons;
    receiveAll(receive, polygons.points, header.points);
    receiveAll(receive, polygons.corners, header.corners);
    receiveAll(receive, polygons.sizes, header.sizes);
    for (std::uint64_t i = 0; i < header.notes; ++i) polygons.notes.push_back(receiveText(receive));
    if (!consistent(polygons)) throw ChildFailure("gave a damaged answer");
    return polygons;
}

}  // namespace bilayer::detail
