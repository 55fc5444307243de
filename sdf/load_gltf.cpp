#define TINYGLTF_IMPLEMENTATION
#include "sdf/load_gltf.h"

#include <fmt/format.h>

#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "sdf/input_file.h"

namespace bilayer {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<unsigned char>;

// Extensions that change the shape of what is read, and are understood.
constexpr std::string_view understood[] = {"KHR_mesh_quantization", "EXT_mesh_gpu_instancing"};
// Beginnings of the names of those that only say how things look or sound, and who made them.
constexpr std::string_view looks[] = {"KHR_materials_",      "KHR_texture_",        "EXT_texture_", "MSFT_texture_",
                                      "KHR_lights_",         "EXT_lights_",         "KHR_xmp",      "KHR_audio",
                                      "KHR_environment_map", "KHR_techniques_webgl"};
// Those that hold the geometry itself, even if they are only said to be used.
constexpr std::string_view compressions[] = {"KHR_draco_mesh_compression", "EXT_meshopt_compression",
                                             "KHR_meshopt_compression"};

constexpr std::size_t glbHeader = 20;  // [bytes]: before the JSON of a binary file, whose length is the number at 12
constexpr int maxNesting = 200;        // of objects and arrays; tinygltf calls itself once for each

Bytes readBytes(const fs::path& path) {
    requireInputFile(path);
    std::ifstream stream(path, std::ios::binary);
    Bytes bytes(fs::file_size(path));
    stream.read(reinterpret_cast<char*>(bytes.data()), std::streamsize(bytes.size()));
    if (!stream) throw std::runtime_error("cannot be read to its end");
    return bytes;
}

bool isBinary(const Bytes& bytes) {
    return bytes.size() >= glbHeader && std::memcmp(bytes.data(), "glTF", 4) == 0;
}

std::string_view jsonOf(const Bytes& bytes) {
    const std::string_view all(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (!isBinary(bytes)) return all;
    std::uint32_t version = 0, length = 0;
    std::memcpy(&version, bytes.data() + 4, sizeof version);
    std::memcpy(&length, bytes.data() + 12, sizeof length);
    if (version != 2) throw std::runtime_error(fmt::format("is binary glTF {}; only glTF 2 is read", version));
    return all.substr(glbHeader, length);
}

void checkNesting(std::string_view json) {
    int depth = 0;
    bool inString = false;
    for (std::size_t i = 0; i < json.size(); ++i) {
        const char c = json[i];
        if (inString && c == '\\') {
            ++i;
        } else if (c == '"') {
            inString = !inString;
        } else if (!inString) {
            depth += (c == '{' || c == '[') - (c == '}' || c == ']');
            if (depth > maxNesting)
                throw std::runtime_error(fmt::format("byte {} of its JSON is nested more than {} deep", i, maxNesting));
        }
    }
}

// Files of buffers for tinygltf: regular files in the folder of the scene. A file may be longer than its buffer, as
// glTF allows; tinygltf wants it of the very length, so that it is cut to that.
class BufferFiles {
  public:
    BufferFiles(fs::path folder, std::string_view json) : folder_(std::move(folder)) {
        const auto onlyBuffers = [](int depth, nlohmann::json::parse_event_t event, nlohmann::json& parsed) {
            return depth != 1 || event != nlohmann::json::parse_event_t::key || parsed == "buffers";
        };
        const nlohmann::json file = nlohmann::json::parse(json.begin(), json.end(), onlyBuffers, false);
        if (!file.is_object() || !file.contains("buffers") || !file["buffers"].is_array()) return;
        for (const nlohmann::json& buffer : file["buffers"])
            if (buffer.is_object() && buffer.contains("uri") && buffer["uri"].is_string() &&
                buffer.contains("byteLength") && buffer["byteLength"].is_number_unsigned())
                add(buffer["uri"], buffer["byteLength"]);
    }

    tinygltf::FsCallbacks callbacks() { return {exists, expand, readWhole, nullptr, this}; }

  private:
    struct Declared {
        fs::path name;  // what tinygltf will ask for
        fs::path file;
        std::size_t length;
    };

    void add(const std::string& uri, std::size_t length) {
        if (tinygltf::IsDataURI(uri)) return;
        const fs::path decoded = folder_ / tinygltf::dlib::urldecode(uri), literal = folder_ / uri;
        declared_.push_back({decoded, isFile(literal) ? literal : decoded, length});
    }
    static bool isFile(const fs::path& path) {
        std::error_code absent;
        return fs::is_regular_file(path, absent);
    }
    static const Declared* find(const fs::path& name, void* self) {
        for (const Declared& d : static_cast<BufferFiles*>(self)->declared_)
            if (d.name == name) return &d;
        return nullptr;
    }

    static bool exists(const std::string& name, void* self) {
        const Declared* declared = find(name, self);
        return declared && isFile(declared->file);
    }
    static std::string expand(const std::string& file, void*) { return file; }
    static bool readWhole(Bytes* bytes, std::string* error, const std::string& name, void* self) try {
        const Declared* declared = find(name, self);
        if (!declared) return false;
        *bytes = readBytes(declared->file);
        if (bytes->size() > declared->length) bytes->resize(declared->length);
        return true;
    } catch (const std::runtime_error& e) {
        *error = e.what();
        return false;
    }

    fs::path folder_;
    std::vector<Declared> declared_;
};

template <class Names>
bool contains(const Names& names, std::string_view name) {
    return std::find(std::begin(names), std::end(names), name) != std::end(names);
}

bool isUnderstood(std::string_view name) {
    if (contains(understood, name)) return true;
    return std::any_of(std::begin(looks), std::end(looks),
                       [&](std::string_view beginning) { return name.substr(0, beginning.size()) == beginning; });
}

void checkRequired(const tinygltf::Model& model) {
    for (const std::string& name : model.extensionsRequired)
        if (!isUnderstood(name))
            throw std::runtime_error(
                fmt::format("requires the glTF extension {}, which is not read; export it without", name));
}

bool ignoreImage(tinygltf::Image*, int, std::string*, std::string*, int, int, const unsigned char*, int, void*) {
    return true;
}

// tinygltf's own words, of which one sentence may quote a whole buffer
std::string complaint(const tinygltf::Model& model, std::string error) {
    constexpr std::size_t longest = 120;  // [bytes]
    error = error.substr(0, error.find_last_not_of(" \n\r") + 1);
    if (error.size() > longest) error = error.substr(0, longest) + " ...";
    for (const std::string& name : model.extensionsUsed)
        if (contains(compressions, name)) error += fmt::format(" (it uses {}, which is not read)", name);
    return "is not valid glTF 2: " + error;
}

}  // namespace

tinygltf::Model loadGltf(const fs::path& path) {
    const Bytes bytes = readBytes(path);
    if (bytes.size() > std::numeric_limits<std::uint32_t>::max())
        throw std::runtime_error("has 4 GiB or more; glTF files are smaller");
    const std::string_view json = jsonOf(bytes);
    checkNesting(json);
    const fs::path folder = fs::absolute(path).parent_path();
    BufferFiles files(folder, json);
    tinygltf::TinyGLTF loader;
    loader.SetFsCallbacks(files.callbacks());
    loader.SetImageLoader(ignoreImage, nullptr);
    tinygltf::Model model;
    std::string error, warning;
    const auto size = unsigned(bytes.size());
    const bool loaded = isBinary(bytes)
                            ? loader.LoadBinaryFromMemory(&model, &error, &warning, bytes.data(), size, folder.string())
                            : loader.LoadASCIIFromString(&model, &error, &warning, json.data(), size, folder.string());
    checkRequired(model);
    // it tells of primitives that it leaves out, too
    if (!loaded || !error.empty()) throw std::runtime_error(complaint(model, error));
    if (model.asset.version.substr(0, 2) != "2.")
        throw std::runtime_error(fmt::format("is glTF {}; only glTF 2 is read", model.asset.version.substr(0, 40)));
    return model;
}

}  // namespace bilayer
