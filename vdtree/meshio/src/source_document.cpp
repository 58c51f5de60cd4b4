#include <unseen/meshio/source_document.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>
#include <set>
#include <string_view>
#include <type_traits>

#include "mesh_readers.h"
#include "value_types.h"

namespace unseen::meshio {

namespace {

constexpr std::string_view magic = "UNSEENSD";
constexpr std::uint32_t version = 1, table_version = 2; // without arrays, and with them
constexpr std::uint32_t most_channels = 32;             // bits of Part::channels
constexpr std::size_t array_bytes = 28;                 // of an array without name and values

template <class Value>
Value in_file_order(Value value) {
    if constexpr (std::endian::native == std::endian::big) {
        auto raw = std::bit_cast<std::array<std::byte, sizeof(Value)>>(value);
        std::reverse(raw.begin(), raw.end());
        return std::bit_cast<Value>(raw);
    }
    return value;
}

class Packer {
public:
    explicit Packer(std::size_t room) { bytes_.reserve(magic.size() + 16 + room); }

    template <class Value>
    requires std::is_arithmetic_v<Value>
    void put(Value value) {
        value = in_file_order(value);
        put_bytes(&value, sizeof value);
    }
    void put(std::string_view text) {
        put(std::uint64_t{text.size()});
        put_bytes(text.data(), text.size());
    }
    template <class Value>
    void put(const std::vector<Value>& values) {
        put(std::uint64_t{values.size()});
        if constexpr (std::endian::native == std::endian::little)
            put_bytes(values.data(), values.size() * sizeof(Value));
        else
            for (const Value value : values) put(value);
    }
    void put_bytes(const void* data, std::size_t size) {
        const auto* bytes = static_cast<const std::byte*>(data);
        bytes_.insert(bytes_.end(), bytes, bytes + size);
    }
    std::vector<std::byte> take() { return std::move(bytes_); }

private:
    std::vector<std::byte> bytes_;
};

// Of values whose type is told beside them. (Not used where memory is in the file's order.)
[[maybe_unused]] std::vector<std::byte> values_in_file_order(const VertexArray& array) {
    std::vector<std::byte> values = array.values;
    change_order(values, byte_size(array.type), std::endian::little);
    return values;
}

// Reads nothing once something was missing.
class Unpacker {
public:
    explicit Unpacker(std::span<const std::byte> bytes) : bytes_(bytes) {}

    bool is_good() const { return good_; }
    bool is_at_end() const { return good_ && bytes_.empty(); }

    template <class Value>
    requires std::is_arithmetic_v<Value> Value get() {
        Value value{};
        if (const std::byte* data = take(sizeof value)) std::memcpy(&value, data, sizeof value);
        return in_file_order(value);
    }
    std::string text() {
        const auto size = get<std::uint64_t>();
        const std::byte* data = take(size);
        return data ? std::string(reinterpret_cast<const char*>(data), size) : std::string();
    }
    template <class Value>
    std::vector<Value> array() {
        const std::size_t count = counted(sizeof(Value));
        std::vector<Value> values(count);
        if (count > 0) std::memcpy(values.data(), take(count * sizeof(Value)), count * sizeof(Value));
        if constexpr (std::endian::native == std::endian::big)
            for (Value& value : values) value = in_file_order(value);
        return values;
    }
    // A number of elements that have at least so many bytes each, all of which can be there.
    std::size_t counted(std::size_t least_bytes) {
        const auto count = get<std::uint64_t>();
        if (count > bytes_.size() / least_bytes) good_ = false;
        return good_ ? static_cast<std::size_t>(count) : 0;
    }
    double finite() {
        const auto value = get<double>();
        good_ = good_ && std::isfinite(value);
        return value;
    }

private:
    const std::byte* take(std::uint64_t size) {
        good_ = good_ && size <= bytes_.size();
        if (!good_) return nullptr;
        const std::byte* data = bytes_.data();
        bytes_ = bytes_.subspan(static_cast<std::size_t>(size));
        return data;
    }

    std::span<const std::byte> bytes_;
    bool good_ = true;
};

std::string fault_in_arrays(const SourceDocument& document) {
    std::set<std::string> names;
    std::optional<std::size_t> vertices;
    for (const VertexArray& array : document.arrays) {
        const std::string which = "its array " + in_quotes(array.name);
        if (!names.insert(array.name).second) return which + " is there twice";
        if (array.components < 1) return which + " has no components";
        if (array.role != VertexArray::Role::value) {
            if (!array.values.empty()) return which + " has values of its own";
            continue;
        }
        if (array.values.size() % array.tuple_bytes() != 0 || array.size() != vertices.value_or(array.size()))
            return which + " has the wrong length";
        vertices = array.size();
    }
    return {};
}

// Empty: none.
std::string fault_in(const SourceDocument& document) {
    if (document.format == SourceDocument::Format::table) return fault_in_arrays(document);
    const std::size_t vertices = document.vertex_parts.size(), parts = document.parts.size();
    for (const auto& channel : document.channels)
        if (channel.components < 1 || channel.components > 4 ||
            channel.values.size() != vertices * std::size_t{channel.components})
            return "its channel of vertices " + channel.name + " has the wrong length";
    if (document.channels.size() > most_channels) return "it has too many channels of vertices";
    for (const auto& part : document.parts)
        if (std::uint64_t{part.channels} >> document.channels.size() != 0)
            return "a part has a channel that is not there";
    for (const std::uint32_t part : document.vertex_parts)
        if (part >= parts) return "a vertex has a part that is not there";
    for (std::size_t i = 0; i < document.runs.size(); ++i) {
        const auto& run = document.runs[i];
        const bool is_in_order =
            i == 0 ? run.first_triangle == 0 : run.first_triangle > document.runs[i - 1].first_triangle;
        if (!is_in_order || run.part >= parts) return "its runs of triangles are out of order";
    }
    if (document.runs.empty()) return "it has no runs of triangles";
    return {};
}

void pack_arrays(const std::vector<VertexArray>& arrays, Packer& out) {
    out.put(std::uint64_t{arrays.size()});
    for (const VertexArray& array : arrays) {
        out.put(array.name);
        out.put(static_cast<std::uint32_t>(array.type));
        out.put(array.components);
        out.put(static_cast<std::uint32_t>(array.role));
        out.put(std::uint64_t{array.values.size()});
        if constexpr (std::endian::native == std::endian::little)
            out.put_bytes(array.values.data(), array.values.size());
        else out.put_bytes(values_in_file_order(array).data(), array.values.size());
    }
}

bool unpack_arrays(Unpacker& in, std::vector<VertexArray>& arrays) {
    arrays.resize(in.counted(array_bytes));
    for (VertexArray& array : arrays) {
        array.name = in.text();
        const auto type = in.get<std::uint32_t>();
        array.components = in.get<std::uint32_t>();
        const auto role = in.get<std::uint32_t>();
        if (type < 1 || type > static_cast<std::uint32_t>(ValueType::float64) ||
            role > static_cast<std::uint32_t>(VertexArray::Role::uvs))
            return false;
        array.type = static_cast<ValueType>(type);
        array.role = static_cast<VertexArray::Role>(role);
        array.values = in.array<std::byte>();
        change_order(array.values, byte_size(array.type), std::endian::little);
    }
    return in.is_at_end();
}

} // namespace

std::uint32_t SourceDocument::part_of(std::uint64_t triangle) const {
    const auto after = std::upper_bound(runs.begin(), runs.end(), triangle,
                                        [](std::uint64_t t, const Run& run) { return t < run.first_triangle; });
    return (after - 1)->part;
}

std::vector<std::byte> pack(const SourceDocument& document) {
    std::size_t room = 0; // so that tables are not copied while they grow
    for (const VertexArray& array : document.arrays) room += array_bytes + array.name.size() + array.values.size();
    Packer out(room);
    out.put_bytes(magic.data(), magic.size());
    const bool is_table = document.format == SourceDocument::Format::table;
    out.put(is_table ? table_version : version);
    out.put(static_cast<std::uint32_t>(document.format));
    if (is_table) {
        pack_arrays(document.arrays, out);
        return out.take();
    }
    out.put(document.json);
    out.put(std::uint64_t{document.files.size()});
    for (const auto& file : document.files) {
        out.put(static_cast<std::uint32_t>(file.use));
        out.put(std::uint32_t{file.bytes != nullptr});
        out.put(file.uri);
        out.put(file.bytes ? std::string_view(*file.bytes) : std::string_view());
    }
    out.put(std::uint64_t{document.parts.size()});
    for (const auto& part : document.parts) {
        for (const std::int32_t number : {part.node, part.mesh, part.primitive}) out.put(number);
        out.put(part.channels);
        for (int i = 0; i < 16; ++i) out.put(part.to_world[i / 4][i % 4]);
        for (int i = 0; i < 4; ++i) out.put(part.drawn_uv.linear[i / 2][i % 2]);
        for (int i = 0; i < 2; ++i) out.put(part.drawn_uv.offset[i]);
        for (int i = 0; i < 4; ++i) out.put(static_cast<double>(part.colour[i]));
        for (const std::string& name : {part.object, part.group, part.material}) out.put(name);
    }
    out.put(std::uint64_t{document.runs.size()});
    for (const auto& run : document.runs) {
        out.put(run.first_triangle);
        out.put(run.part);
    }
    out.put(std::uint64_t{document.channels.size()});
    for (const auto& channel : document.channels) {
        out.put(channel.name);
        out.put(channel.components);
        out.put(channel.values);
    }
    out.put(document.vertex_parts);
    return out.take();
}

Result<SourceDocument> unpack(std::span<const std::byte> bytes) {
    const auto fail = [](const std::string& why) {
        return Error{ErrorCode::malformed_data,
                     "The source document of the tree is damaged: " + why + ". Build the tree again from its mesh."};
    };
    const bool is_known = bytes.size() >= magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
    if (!is_known) return fail("it does not begin as one");
    Unpacker in(bytes.subspan(magic.size()));
    const auto found = in.get<std::uint32_t>();
    if (found != version && found != table_version)
        return Error{ErrorCode::unsupported, "The source document of the tree has version " + std::to_string(found) +
                                                 ", and only " + std::to_string(version) + " and " +
                                                 std::to_string(table_version) +
                                                 " are read; build the tree again from its mesh."};
    SourceDocument document;
    const auto format = in.get<std::uint32_t>();
    if (found == table_version ? format != 3 : format != 1 && format != 2) return fail("its format is unknown");
    document.format = static_cast<SourceDocument::Format>(format);
    if (found == table_version) {
        if (!unpack_arrays(in, document.arrays)) return fail("its lengths contradict each other");
        if (const std::string fault = fault_in(document); !fault.empty()) return fail(fault);
        return document;
    }
    document.json = in.text();
    constexpr std::size_t file_bytes = 24, part_bytes = 16 + 26 * 8 + 24, run_bytes = 12, channel_bytes = 20;
    document.files.resize(in.counted(file_bytes));
    for (auto& file : document.files) {
        const auto use = in.get<std::uint32_t>();
        if (use > 1) return fail("a file has an unknown use");
        file.use = static_cast<SourceDocument::File::Use>(use);
        const bool is_at_hand = in.get<std::uint32_t>() != 0;
        file.uri = in.text();
        std::string contents = in.text();
        if (is_at_hand) file.bytes = std::make_shared<const std::string>(std::move(contents));
    }
    document.parts.resize(in.counted(part_bytes));
    for (auto& part : document.parts) {
        for (std::int32_t* number : {&part.node, &part.mesh, &part.primitive}) *number = in.get<std::int32_t>();
        part.channels = in.get<std::uint32_t>();
        for (int i = 0; i < 16; ++i) part.to_world[i / 4][i % 4] = in.finite();
        for (int i = 0; i < 4; ++i) part.drawn_uv.linear[i / 2][i % 2] = in.finite();
        for (int i = 0; i < 2; ++i) part.drawn_uv.offset[i] = in.finite();
        for (int i = 0; i < 4; ++i) part.colour[i] = static_cast<float>(in.finite());
        for (std::string* name : {&part.object, &part.group, &part.material}) *name = in.text();
    }
    document.runs.resize(in.counted(run_bytes));
    for (auto& run : document.runs) {
        run.first_triangle = in.get<std::uint64_t>();
        run.part = in.get<std::uint32_t>();
    }
    document.channels.resize(in.counted(channel_bytes));
    for (auto& channel : document.channels) {
        channel.name = in.text();
        channel.components = in.get<std::uint32_t>();
        channel.values = in.array<float>();
    }
    document.vertex_parts = in.array<std::uint32_t>();
    if (!in.is_at_end()) return fail("its lengths contradict each other");
    if (const std::string fault = fault_in(document); !fault.empty()) return fail(fault);
    return document;
}

} // namespace unseen::meshio
