#include <unseen/meshio/source_document.h>

#include <set>

#include <nlohmann/json.hpp>

#include "mesh_readers.h"
#include "value_types.h"
#include "weld.h"

namespace unseen::meshio {

// ---- values of vertices

const char* name_of(ValueType type) {
    constexpr const char* names[] = {"int8",   "uint8", "int16",  "uint16",  "int32",
                                     "uint32", "int64", "uint64", "float32", "float64"};
    return names[static_cast<std::size_t>(type) - 1];
}

bool is_integer(ValueType type) { return type != ValueType::float32 && type != ValueType::float64; }

double VertexArray::number(std::size_t vertex, std::uint32_t component) const {
    return with_type(type, [&](auto tag) {
        using T = typename decltype(tag)::type;
        return static_cast<double>(load_value<T>(values.data() + vertex * tuple_bytes() + component * sizeof(T)));
    });
}

ValueRange range_of(const VertexArray& array, std::uint32_t component) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    ValueRange range{infinity, -infinity, 0};
    for (std::size_t v = 0; v < array.size(); ++v) {
        const double value = array.number(v, component);
        if (!std::isfinite(value)) {
            ++range.not_finite;
            continue;
        }
        range.low = std::min(range.low, value);
        range.high = std::max(range.high, value);
    }
    return range;
}

// ---- documents

namespace {

constexpr std::string_view magic = "UNSEENSD";
constexpr std::uint32_t version = 1, table_version = 2; // without arrays, and with them
constexpr std::uint32_t most_channels = 32;             // bits of Part::channels
constexpr std::size_t array_bytes = 28;                 // of an array without name and values

template <class Value>
concept Number = std::is_arithmetic_v<Value> || std::is_enum_v<Value>; // and std::byte

// Writes what is handed to it.
class Packer {
public:
    explicit Packer(std::size_t room) { bytes_.reserve(magic.size() + 16 + room); }

    void operator()(const Number auto& value) { bytes(&value, sizeof value); }
    // Texts and vectors of numbers.
    template <class Values>
    requires Number<typename Values::value_type>
    void operator()(const Values& values) {
        (*this)(std::uint64_t{values.size()});
        bytes(values.data(), values.size() * sizeof(values[0]));
    }
    void for_each(const auto& elements, std::size_t, auto&& visit) {
        (*this)(std::uint64_t{elements.size()});
        for (const auto& element : elements) visit(element);
    }
    void bytes(const void* data, std::size_t size) {
        const auto* bytes = static_cast<const std::byte*>(data);
        bytes_.insert(bytes_.end(), bytes, bytes + size);
    }
    void as_double(float value) { (*this)(static_cast<double>(value)); }
    void contents(const std::shared_ptr<const std::string>& bytes, std::uint32_t) { (*this)(bytes ? *bytes : ""); }
    std::vector<std::byte> take() { return std::move(bytes_); }

private:
    std::vector<std::byte> bytes_;
};

// Reads into what is handed to it; nothing once something was missing, or a double was no number.
class Unpacker {
public:
    explicit Unpacker(std::span<const std::byte> bytes) : bytes_(bytes) {}

    bool is_at_end() const { return good_ && bytes_.empty(); }

    template <Number Value>
    void operator()(Value& value) {
        bytes(&value, sizeof value);
        if constexpr (std::is_same_v<Value, double>) good_ = good_ && std::isfinite(value);
    }
    template <class Values>
    requires Number<typename Values::value_type>
    void operator()(Values& values) {
        values.resize(counted(sizeof(values[0])));
        bytes(values.data(), values.size() * sizeof(values[0]));
    }
    // Elements that have at least so many bytes each, all of which can be there.
    void for_each(auto& elements, std::size_t least_bytes, auto&& visit) {
        elements.resize(counted(least_bytes));
        for (auto& element : elements) visit(element);
    }
    void as_double(float& value) {
        double read = 0;
        (*this)(read);
        value = static_cast<float>(read);
    }
    void contents(std::shared_ptr<const std::string>& bytes, std::uint32_t is_there) {
        std::string read;
        (*this)(read);
        if (is_there != 0) bytes = std::make_shared<const std::string>(std::move(read));
    }

private:
    std::size_t counted(std::size_t least_bytes) {
        std::uint64_t count = 0;
        (*this)(count);
        good_ = good_ && count <= bytes_.size() / least_bytes;
        return good_ ? static_cast<std::size_t>(count) : 0;
    }
    void bytes(void* to, std::size_t size) {
        good_ = good_ && size <= bytes_.size();
        if (!good_ || size == 0) return;
        std::memcpy(to, bytes_.data(), size);
        bytes_ = bytes_.subspan(size);
    }

    std::span<const std::byte> bytes_;
    bool good_ = true;
};

// What is packed and unpacked, in this order: of a table its arrays ...
void visit_table(auto& archive, auto& document) {
    archive.for_each(document.arrays, array_bytes, [&](auto& array) {
        archive(array.name), archive(array.type), archive(array.components), archive(array.role);
        archive(array.values);
    });
}

// ... and of other documents all else.
void visit_document(auto& archive, auto& document) {
    constexpr std::size_t file_bytes = 24, part_bytes = 16 + 26 * 8 + 24, run_bytes = 12, channel_bytes = 20;
    archive(document.json);
    archive.for_each(document.files, file_bytes, [&](auto& file) {
        std::uint32_t is_there = file.bytes != nullptr;
        archive(file.use), archive(is_there), archive(file.uri);
        archive.contents(file.bytes, is_there);
    });
    archive.for_each(document.parts, part_bytes, [&](auto& part) {
        archive(part.node), archive(part.mesh), archive(part.primitive), archive(part.channels);
        for (int i = 0; i < 16; ++i) archive(part.to_world[i / 4][i % 4]);
        for (int i = 0; i < 4; ++i) archive(part.drawn_uv.linear[i / 2][i % 2]);
        for (int i = 0; i < 2; ++i) archive(part.drawn_uv.offset[i]);
        for (int i = 0; i < 4; ++i) archive.as_double(part.colour[i]);
        archive(part.object), archive(part.group), archive(part.material);
    });
    archive.for_each(document.runs, run_bytes, [&](auto& run) { archive(run.first_triangle), archive(run.part); });
    archive.for_each(document.channels, channel_bytes, [&](auto& channel) {
        archive(channel.name), archive(channel.components), archive(channel.values);
    });
    archive(document.vertex_parts);
}

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

} // namespace

std::vector<std::uint32_t> further_values(const SourceDocument& document) {
    // By bits, so that NaN is equal to itself.
    std::vector<std::span<const std::byte>> columns; // all values of one kind, and the bytes that each vertex has
    std::vector<std::size_t> widths;
    const auto add = [&](std::span<const std::byte> values, std::size_t width) {
        if (!values.empty()) columns.push_back(values), widths.push_back(width);
    };
    for (const auto& array : document.arrays) add(array.values, array.tuple_bytes());
    for (const auto& channel : document.channels)
        add(std::as_bytes(std::span(channel.values)), channel.components * sizeof(float));
    if (columns.empty()) return {};
    const auto channels_of = [&](std::size_t v) {
        return document.vertex_parts.empty() ? 0 : document.parts[document.vertex_parts[v]].channels;
    };
    const auto value = [&](std::size_t column, std::size_t v) {
        return columns[column].subspan(v * widths[column], widths[column]);
    };
    return find_first_same(
        columns[0].size() / widths[0],
        [&](SeededHash& hash, std::size_t v) {
            hash.add(channels_of(v));
            for (std::size_t c = 0; c < columns.size(); ++c)
                for (auto left = value(c, v); !left.empty();
                     left = left.subspan(std::min<std::size_t>(left.size(), 8))) {
                    std::uint64_t word = 0;
                    std::memcpy(&word, left.data(), std::min<std::size_t>(left.size(), sizeof word));
                    hash.add(word);
                }
        },
        [&](std::size_t a, std::size_t b) {
            for (std::size_t c = 0; c < columns.size(); ++c)
                if (std::memcmp(value(c, a).data(), value(c, b).data(), widths[c]) != 0) return false;
            return channels_of(a) == channels_of(b);
        });
}

std::vector<std::byte> pack(const SourceDocument& document) {
    std::size_t room = 0; // so that tables are not copied while they grow
    for (const VertexArray& array : document.arrays) room += array_bytes + array.name.size() + array.values.size();
    Packer out(room);
    out.bytes(magic.data(), magic.size());
    const bool is_table = document.format == SourceDocument::Format::table;
    out(is_table ? table_version : version);
    out(document.format);
    if (is_table) visit_table(out, document);
    else visit_document(out, document);
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
    std::uint32_t found = 0;
    in(found);
    if (found != version && found != table_version)
        return Error{ErrorCode::unsupported,
                     text_of("The source document of the tree has version ", found, ", and only ", version, " and ",
                             table_version, " are read; build the tree again from its mesh.")};
    SourceDocument document;
    in(document.format);
    using Format = SourceDocument::Format;
    const bool is_table = document.format == Format::table;
    if ((!is_table && document.format != Format::gltf && document.format != Format::obj) ||
        is_table != (found == table_version))
        return fail("its format is unknown");
    if (is_table) visit_table(in, document);
    else visit_document(in, document);
    const bool has_roles = std::ranges::all_of(document.arrays, [](const VertexArray& array) {
        return array.type >= ValueType::int8 && array.type <= ValueType::float64 &&
               array.role <= VertexArray::Role::uvs;
    });
    if (!in.is_at_end() || !has_roles) return fail("its lengths contradict each other");
    for (const SourceDocument::File& file : document.files)
        if (file.use > SourceDocument::File::Use::library) return fail("a file has an unknown use");
    if (const std::string fault = fault_in(document); !fault.empty()) return fail(fault);
    return document;
}

} // namespace unseen::meshio
