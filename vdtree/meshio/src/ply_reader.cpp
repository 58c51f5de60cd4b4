// PLY: G. Turk, The PLY polygon file format (1994). ASCII and both byte orders; any properties in any order.
#include "face_collector.h"
#include "kept_arrays.h"
#include "mesh_readers.h"
#include "ply_slots.h"
#include "text_scanner.h"
#include "value_types.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

namespace unseen::meshio {

using namespace ply;

namespace {

enum class Encoding : std::uint8_t { ascii, little_endian, big_endian };

struct Property {
    std::string name;
    ValueType type = ValueType::float32;
    bool is_list = false;
    ValueType count_type = ValueType::uint8;
};

struct Element {
    std::string name;
    std::uint64_t count = 0;
    std::vector<Property> properties;
};

struct Header {
    Encoding encoding = Encoding::ascii;
    std::vector<Element> elements;
    std::size_t body = 0; // where the data start
};

std::optional<ValueType> to_type(std::string_view name) {
    struct Name {
        std::string_view classic, sized;
        ValueType type;
    };
    static constexpr std::array<Name, 8> names{{{"char", "int8", ValueType::int8},
                                                {"uchar", "uint8", ValueType::uint8},
                                                {"short", "int16", ValueType::int16},
                                                {"ushort", "uint16", ValueType::uint16},
                                                {"int", "int32", ValueType::int32},
                                                {"uint", "uint32", ValueType::uint32},
                                                {"float", "float32", ValueType::float32},
                                                {"double", "float64", ValueType::float64}}};
    for (const Name& candidate : names)
        if (name == candidate.classic || name == candidate.sized) return candidate.type;
    return std::nullopt;
}

// ---- header ----

Result<Property> parse_property(const MeshSource& source, std::uint64_t line_number, std::string_view line) {
    Property property;
    std::string_view word = take_word(line);
    if (word == "list") {
        property.is_list = true;
        word = take_word(line);
        const auto count_type = to_type(word);
        if (!count_type || !is_integer(*count_type))
            return malformed_line(source, line_number,
                                  "a list is counted by an integer type, not by " + in_quotes(word) +
                                      "; correct the header.");
        property.count_type = *count_type;
        word = take_word(line);
    }
    const auto type = to_type(word);
    if (!type) return malformed_line(source, line_number, in_quotes(word) + " is no type of PLY; correct the header.");
    property.type = *type;
    property.name = take_word(line);
    if (property.name.empty()) return malformed_line(source, line_number, "the property has no name; give it one.");
    return property;
}

Result<Element> parse_element(const MeshSource& source, std::uint64_t line_number, std::string_view line) {
    Element element;
    element.name = take_word(line);
    const std::string_view count = take_word(line);
    const char* last = count.data() + count.size();
    const auto [end, error] = std::from_chars(count.data(), last, element.count);
    if (element.name.empty() || error != std::errc() || end != last)
        return malformed_line(source, line_number,
                              "an element needs a name and a count of 0 or more, not " + in_quotes(count) + ".");
    return element;
}

Result<Encoding> parse_format(const MeshSource& source, std::uint64_t line_number, std::string_view line) {
    const std::string_view name = take_word(line);
    const std::string_view version = take_word(line);
    if (version != "1.0")
        return malformed_line(source, line_number,
                              "version " + in_quotes(version) + " of PLY is unknown; expected 1.0.");
    if (name == "ascii") return Encoding::ascii;
    if (name == "binary_little_endian") return Encoding::little_endian;
    if (name == "binary_big_endian") return Encoding::big_endian;
    return malformed_line(source, line_number,
                          "the format " + in_quotes(name) +
                              " is unknown; expected ascii, "
                              "binary_little_endian or binary_big_endian.");
}

// The byte after end_header's newline. A CR before an LF belongs to it unless the header's lines end in a lone CR: then
// the LF is already data.
std::size_t body_start(std::string_view bytes, std::size_t line_end) {
    const std::size_t first_newline = bytes.find_first_of("\r\n");
    const bool has_lone_cr = bytes[first_newline] == '\r' && bytes.substr(first_newline, 2) != "\r\n";
    if (!has_lone_cr && bytes.substr(line_end, 2) == "\r\n") return line_end + 2;
    return std::min(line_end + 1, bytes.size());
}

Result<Header> parse_header(const MeshSource& source) {
    Header header;
    bool has_format = false;
    LineScanner lines(source.bytes);
    std::string_view line;
    lines.next(line); // "ply"
    while (lines.next(line)) {
        const std::string_view whole_line = line;
        const std::string_view keyword = take_word(line);
        if (keyword == "end_header") {
            if (!has_format) return malformed(source, "its header has no format line; add one.");
            const auto line_end = static_cast<std::size_t>(whole_line.data() - source.bytes.data()) + whole_line.size();
            header.body = body_start(source.bytes, line_end);
            return header;
        }
        if (keyword == "format") {
            const Result<Encoding> encoding = parse_format(source, lines.line(), line);
            if (!encoding) return encoding.error();
            header.encoding = *encoding;
            has_format = true;
        } else if (keyword == "element") {
            Result<Element> element = parse_element(source, lines.line(), line);
            if (!element) return element.error();
            header.elements.push_back(std::move(*element));
        } else if (keyword == "property") {
            if (header.elements.empty())
                return malformed_line(source, lines.line(), "a property before the first element; correct the header.");
            Result<Property> property = parse_property(source, lines.line(), line);
            if (!property) return property.error();
            header.elements.back().properties.push_back(std::move(*property));
        } else if (keyword != "comment" && keyword != "obj_info" && !keyword.empty()) {
            return malformed_line(source, lines.line(),
                                  in_quotes(keyword) + " is no keyword of a PLY header; the file may be damaged.");
        }
    }
    return malformed(source, "its header has no end_header line; the file may be cut short.");
}

// ---- bodies: the same few operations on text and on bytes ----

bool to_index(double number, std::int64_t& value, std::string& why) {
    constexpr double largest = 9.0e15; // beyond this no index is valid, and the conversion would be undefined
    if (!(std::abs(number) <= largest) || number != std::floor(number)) {
        why = "an index is not a whole number";
        return false;
    }
    value = static_cast<std::int64_t>(number);
    return true;
}

// Every operation returns false where the data end or are no number; why() then says so.
class AsciiBody {
public:
    AsciiBody(std::string_view bytes, std::size_t position) : bytes_(bytes), words_(bytes, false, position) {}

    // The fewest bytes a value can take: a digit and the space before the next.
    static std::size_t min_size(ValueType) { return 2; }

    bool real(ValueType, double& value) {
        const std::string_view word = words_.next();
        return accept(word, to_number(word, value));
    }
    bool integer(ValueType type, std::int64_t& value) {
        if (!is_integer(type)) {
            double number = 0.0;
            if (!real(type, number)) return false;
            return to_index(number, value, why_);
        }
        const std::string_view word = words_.next();
        return accept(word, to_integer(word, value));
    }
    bool skip(ValueType, std::uint64_t count) {
        for (; count > 0; --count)
            if (words_.next().empty()) return accept({}, false);
        return true;
    }
    // One more than there are, as the last value needs no space behind it.
    std::size_t remaining() const { return words_.remaining() + 1; }
    std::size_t position() const { return words_.position(); }
    std::string where() const { return "line " + std::to_string(line_number(bytes_, words_.position())); }
    const std::string& why() const { return why_; }
    bool has_rest() { return !words_.next().empty(); }

private:
    bool accept(std::string_view word, bool is_number) {
        if (!is_number) why_ = word.empty() ? "the file ends there" : in_quotes(word) + " is no number of its type";
        return is_number;
    }
    std::string_view bytes_;
    WordScanner words_;
    std::string why_;
};

template <std::endian order>
class BinaryBody {
public:
    BinaryBody(std::string_view bytes, std::size_t position) : bytes_(bytes), position_(position) {}

    static std::size_t min_size(ValueType type) { return byte_size(type); }

    bool real(ValueType type, double& value) { return any(type, value); }
    bool integer(ValueType type, std::int64_t& value) {
        if (is_integer(type)) return any(type, value);
        double number = 0.0;
        if (!any(type, number)) return false;
        return to_index(number, value, why_);
    }
    bool skip(ValueType type, std::uint64_t count) {
        if (count > remaining() / byte_size(type)) return ended();
        position_ += count * byte_size(type);
        return true;
    }
    std::size_t remaining() const { return bytes_.size() - position_; }
    std::size_t position() const { return position_; }
    std::string where() const { return "byte " + std::to_string(position_); }
    const std::string& why() const { return why_; }
    bool has_rest() const { return remaining() > 0; }

private:
    template <class Value>
    bool any(ValueType type, Value& value) {
        return with_type(type, [&](auto tag) { return this->template get<typename decltype(tag)::type>(value); });
    }
    template <class Stored, class Value>
    bool get(Value& value) {
        if (remaining() < sizeof(Stored)) return ended();
        std::array<char, sizeof(Stored)> raw;
        std::memcpy(raw.data(), bytes_.data() + position_, sizeof(Stored));
        if constexpr (order != std::endian::native) std::reverse(raw.begin(), raw.end());
        // Only integers are read as integers; the branch is for the compiler.
        if constexpr (std::is_floating_point_v<Value> || std::is_integral_v<Stored>)
            value = static_cast<Value>(std::bit_cast<Stored>(raw));
        position_ += sizeof(Stored);
        return true;
    }
    bool ended() {
        why_ = "the file ends there";
        return false;
    }

    std::string_view bytes_;
    std::size_t position_;
    std::string why_;
};

// ---- vertices ----

Slot slot_of(const Property& property) { return property.is_list ? ignored : ply::slot_of(property.name); }

// What a colour channel of full strength is stored as.
double full_channel(ValueType type) {
    switch (type) {
    case ValueType::float32:
    case ValueType::float64: return 1.0;
    case ValueType::uint16: return 65535.0;
    case ValueType::int16: return 32767.0;
    case ValueType::int8: return 127.0;
    default: return 255.0; // also the four-byte integers, in which some writers store bytes
    }
}

struct VertexLayout {
    std::vector<Slot> slots;                // for each property; ignored: its values are kept as they are
    std::array<double, slot_count> scale{}; // colour channels to 0..1
    std::array<bool, slot_count> present{};

    bool has(std::initializer_list<Slot> wanted) const {
        return std::all_of(wanted.begin(), wanted.end(), [&](Slot slot) { return present[slot]; });
    }
};

VertexLayout vertex_layout(const Element& element) {
    VertexLayout layout;
    for (const Property& property : element.properties) {
        Slot slot = slot_of(property);
        if (layout.present[slot]) slot = ignored; // the first of that name counts
        layout.slots.push_back(slot);
        layout.present[slot] = true;
        layout.scale[slot] = 1.0 / full_channel(property.type);
    }
    // A lone nx is no normal.
    const auto keep_if = [&](bool is_whole, std::initializer_list<Slot> group) {
        for (const Slot slot : group) {
            if (is_whole || !layout.present[slot]) continue;
            std::replace(layout.slots.begin(), layout.slots.end(), slot, ignored);
            layout.present[slot] = false;
        }
    };
    keep_if(layout.has({nx, ny, nz}), {nx, ny, nz});
    keep_if(layout.has({red, green, blue}), {red, green, blue, alpha});
    keep_if(layout.has({u, v}), {u, v});
    return layout;
}

// Values of vertices that the mesh has no place for.
class PlyArrays {
public:
    PlyArrays(const Element& element, const VertexLayout& layout) {
        for (std::size_t i = 0; i < element.properties.size(); ++i) {
            const Property& property = element.properties[i];
            of_property_.push_back(arrays_.size());
            if (layout.slots[i] != ignored) continue;
            if (property.is_list) {
                lists_.push_back(property.name);
                continue;
            }
            arrays_.push_back({.name = property.name, .type = property.type});
            arrays_.back().values.reserve(element.count * byte_size(property.type));
        }
        misfits_.resize(arrays_.size());
    }

    // The next value of a property that is no list. Texts may hold numbers that the property's type cannot.
    void add(std::size_t property, double value) {
        const std::size_t number = of_property_[property];
        VertexArray& array = arrays_[number];
        with_type(array.type, [&](auto tag) {
            using T = typename decltype(tag)::type;
            if (std::is_integral_v<T> &&
                !(value >= static_cast<double>(std::numeric_limits<T>::lowest()) &&
                  value <= static_cast<double>(std::numeric_limits<T>::max()) && value == std::floor(value))) {
                if (!misfits_[number]) misfits_[number] = array.size();
                value = 0;
            }
            append_value(array.values, static_cast<T>(value));
        });
    }

    void hand_over(ReadResult& result) {
        std::vector<VertexArray> kept;
        for (std::size_t i = 0; i < arrays_.size(); ++i) {
            if (!misfits_[i]) {
                kept.push_back(std::move(arrays_[i]));
                continue;
            }
            result.warnings.push_back("the property " + in_quotes(arrays_[i].name) + " was left out: that of vertex " +
                                      std::to_string(*misfits_[i]) + " is no " + name_of(arrays_[i].type) +
                                      ", as the header says.");
        }
        if (!lists_.empty())
            result.notes.push_back("lists of vertices were left out: " + listed(lists_) + "; single values are kept.");
        keep_arrays(result, std::move(kept));
    }

private:
    std::vector<std::size_t> of_property_; // the number of its array
    std::vector<VertexArray> arrays_;
    std::vector<std::optional<std::size_t>> misfits_; // by array: the first vertex whose value does not fit
    std::vector<std::string> lists_;
};

// ---- the file ----

const Property* index_list(const Element& element) {
    for (const Property& property : element.properties)
        if (property.is_list && (property.name == "vertex_indices" || property.name == "vertex_index"))
            return &property;
    return nullptr;
}

bool is_strip_element(const Element& element) { return element.name == "tristrips"; }
bool is_face_element(const Element& element) { return element.name == "face" || is_strip_element(element); }

template <class Body>
class BodyReader {
public:
    BodyReader(const MeshSource& source, const Header& header) : source_(source), header_(header) {}

    Result<ReadResult> read() {
        if (Result<void> plan = check_elements(); !plan) return plan.error();
        if (Result<void> done = read_elements(); !done) return done.error();
        faces_.warn();
        if (!face_values_.empty())
            result_.notes.push_back("values of faces were left out: " + listed(face_values_) +
                                    "; those of vertices are kept.");
        return std::move(result_);
    }

private:
    Result<void> check_elements() {
        bool has_faces = false;
        for (const Element& element : header_.elements) {
            if (element.name == "vertex") {
                if (vertices_ != nullptr) return malformed(source_, "it has two elements named vertex; remove one.");
                vertices_ = &element;
            }
            if (!is_face_element(element)) continue;
            if (element.count > 0 && index_list(element) == nullptr)
                return malformed(source_, "its element " + in_quotes(element.name) +
                                              " has no list named vertex_indices; correct the header.");
            has_faces = has_faces || element.count > 0;
        }
        if (vertices_ == nullptr) return malformed(source_, "it has no element named vertex; it is no mesh.");
        if (!has_faces) return malformed(source_, "it has no faces; give a file with a surface, not only with points.");
        if (vertices_->count > std::numeric_limits<Index>::max())
            return malformed(source_, "it claims " + std::to_string(vertices_->count) +
                                          " vertices, and indices have 32 bits; split the mesh.");
        return {};
    }

    Result<void> read_elements() {
        Body body(source_.bytes, header_.body);
        bool has_vertices = false;
        // Faces in front of the vertices wait: polygons are cut by their corners' positions.
        std::vector<std::pair<const Element*, Body>> waiting;
        for (const Element& element : header_.elements) {
            if (Result<void> fits = check_count(body, element); !fits) return fits;
            Result<void> done;
            if (&element == vertices_) {
                done = read_vertices(body, element);
                has_vertices = true;
            } else if (is_face_element(element) && has_vertices) {
                done = read_faces(body, element);
            } else {
                if (is_face_element(element)) waiting.emplace_back(&element, body);
                done = skip_element(body, element);
            }
            if (!done) return done;
        }
        if (body.has_rest()) warn("data behind the last element were ignored.");
        for (auto& [element, start] : waiting)
            if (Result<void> done = read_faces(start, *element); !done) return done;
        return {};
    }

    // Before anything is allocated for the element or looped over.
    Result<void> check_count(const Body& body, const Element& element) {
        if (element.count == 0) return {};
        if (element.properties.empty())
            return malformed(source_,
                             "its element " + in_quotes(element.name) + " has no properties; correct the header.");
        std::size_t row = 0;
        for (const Property& property : element.properties)
            row += Body::min_size(property.is_list ? property.count_type : property.type);
        if (element.count <= body.remaining() / row) return {};
        return malformed(source_, "it claims " + std::to_string(element.count) + " rows of element " +
                                      in_quotes(element.name) + ", but only " + std::to_string(body.remaining()) +
                                      " bytes are left for them; the file is cut short or its header is wrong.");
    }

    Error broken(const Body& body, const Element& element, std::uint64_t row) const {
        return malformed(source_, body.where() + ": row " + std::to_string(row) + " of " +
                                      std::to_string(element.count) + " of element " + in_quotes(element.name) +
                                      " cannot be read: " + body.why() + ".");
    }

    Result<void> skip_element(Body& body, const Element& element) {
        for (std::uint64_t row = 0; row < element.count; ++row) {
            if (!pulse(body, row)) return cancelled(source_);
            for (const Property& property : element.properties)
                if (!skip_property(body, property)) return broken(body, element, row);
        }
        return {};
    }

    bool skip_property(Body& body, const Property& property) {
        if (!property.is_list) return body.skip(property.type, 1);
        std::int64_t count = 0;
        return body.integer(property.count_type, count) && count >= 0 &&
               body.skip(property.type, static_cast<std::uint64_t>(count));
    }

    Result<void> read_vertices(Body& body, const Element& element) {
        const VertexLayout layout = vertex_layout(element);
        if (!layout.has({x, y, z})) return malformed(source_, "its vertices have no x, y and z; it is no mesh.");
        const bool has_normals = layout.has({nx, ny, nz});
        const bool has_colours = layout.has({red, green, blue});
        const bool has_uvs = layout.has({u, v});

        Mesh& mesh = result_.mesh;
        mesh.positions.reserve(element.count);
        if (has_normals) mesh.normals.reserve(element.count);
        if (has_colours) mesh.colours.reserve(element.count);
        if (has_uvs) mesh.uvs.reserve(element.count);
        PlyArrays arrays(element, layout);
        std::array<double, slot_count> value{};
        for (std::uint64_t row = 0; row < element.count; ++row) {
            if (!pulse(body, row)) return cancelled(source_);
            for (std::size_t i = 0; i < layout.slots.size(); ++i) {
                const Property& property = element.properties[i];
                const bool read =
                    property.is_list ? skip_property(body, property) : body.real(property.type, value[layout.slots[i]]);
                if (!read) return broken(body, element, row);
                if (layout.slots[i] == ignored && !property.is_list) arrays.add(i, value[ignored]);
            }
            mesh.positions.emplace_back(value[x], value[y], value[z]);
            check_position(result_.bad, mesh.positions.back(),
                           [&] { return body.where() + ": vertex " + std::to_string(row); });
            if (has_normals) mesh.normals.emplace_back(value[nx], value[ny], value[nz]);
            if (has_colours) mesh.colours.push_back(colour(layout, value));
            if (has_uvs) mesh.uvs.emplace_back(value[u], value[v]);
        }
        arrays.hand_over(result_);
        return {};
    }

    glm::vec4 colour(const VertexLayout& layout, const std::array<double, slot_count>& value) const {
        glm::vec4 encoded(1.0f);
        for (int i = 0; i < 4; ++i) {
            const std::size_t slot = static_cast<std::size_t>(red) + static_cast<std::size_t>(i);
            if (layout.present[slot]) encoded[i] = static_cast<float>(value[slot] * layout.scale[slot]);
        }
        return decode_colour(encoded, source_.options.colours);
    }

    Result<void> read_faces(Body& body, const Element& element) {
        const Property* indices = index_list(element);
        if (indices == nullptr) return skip_element(body, element); // only where there are no rows
        // Room for the rows that the bytes left can hold as triangles, whatever the count says.
        const std::size_t smallest = Body::min_size(indices->count_type) + 3 * Body::min_size(indices->type);
        result_.mesh.triangles.reserve(result_.mesh.triangles.size() +
                                       std::min<std::uint64_t>(element.count, body.remaining() / smallest));
        for (const Property& property : element.properties)
            if (&property != indices) face_values_.push_back(property.name);
        const FaceVertices vertices{0, vertices_->count};
        for (std::uint64_t row = 0; row < element.count; ++row) {
            if (!pulse(body, row)) return cancelled(source_);
            for (const Property& property : element.properties) {
                if (&property != indices) {
                    if (!skip_property(body, property)) return broken(body, element, row);
                    continue;
                }
                if (Result<void> list = read_index_list(body, element, property, row); !list) return list;
                const bool is_strip = is_strip_element(element);
                const auto where = [&] {
                    return body.where() + ": " + (is_strip ? "strip " : "face ") + std::to_string(row);
                };
                if (is_strip) faces_.add_strip(corners_, vertices, true, where);
                else faces_.add_polygon(corners_, vertices, where);
            }
        }
        return {};
    }

    Result<void> read_index_list(Body& body, const Element& element, const Property& property, std::uint64_t row) {
        std::int64_t count = 0;
        if (!body.integer(property.count_type, count)) return broken(body, element, row);
        if (count < 0 || static_cast<std::uint64_t>(count) > body.remaining() / Body::min_size(property.type))
            return malformed(source_, body.where() + ": face " + std::to_string(row) + " claims " +
                                          std::to_string(count) + " corners, but only " +
                                          std::to_string(body.remaining()) +
                                          " bytes are left; the file is damaged or cut short.");
        corners_.resize(static_cast<std::size_t>(count));
        for (std::int64_t& corner : corners_)
            if (!body.integer(property.type, corner)) return broken(body, element, row);
        return {};
    }

    bool pulse(const Body& body, std::uint64_t row) const {
        return row % rows_per_progress != 0 || source_.keep_going(body.position(), "reading PLY");
    }

    void warn(std::string sentence) { result_.warnings.push_back(std::move(sentence)); }

    const MeshSource& source_;
    const Header& header_;
    const Element* vertices_ = nullptr;
    ReadResult result_;
    FaceCollector faces_{result_};
    std::vector<std::int64_t> corners_;
    std::vector<std::string> face_values_; // names of what faces have beside corners
};

} // namespace

Result<ReadResult> read_ply(const MeshSource& source) {
    const Result<Header> header = parse_header(source);
    if (!header) return header.error();
    switch (header->encoding) {
    case Encoding::ascii: return BodyReader<AsciiBody>(source, *header).read();
    case Encoding::little_endian: return BodyReader<BinaryBody<std::endian::little>>(source, *header).read();
    case Encoding::big_endian: return BodyReader<BinaryBody<std::endian::big>>(source, *header).read();
    }
    return malformed(source, "unknown encoding.");
}

} // namespace unseen::meshio
