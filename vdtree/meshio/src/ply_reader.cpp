// PLY: G. Turk, The PLY polygon file format (1994). ASCII and both byte orders; any properties in any order.

#include "face_collector.h"
#include "kept_arrays.h"
#include "mesh_readers.h"
#include "ply_slots.h"
#include "text_scanner.h"
#include "value_types.h"

namespace unseen::meshio {

using namespace ply;

namespace {

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
    std::optional<std::endian> order; // nothing: ASCII
    std::vector<Element> elements;
    std::size_t body = 0; // where the data start
};

std::optional<ValueType> to_type(std::string_view name) {
    for (const ValueType type : {ValueType::int8, ValueType::uint8, ValueType::int16, ValueType::uint16,
                                 ValueType::int32, ValueType::uint32, ValueType::float32, ValueType::float64})
        if (name == classic_name(type) || name == name_of(type)) return type;
    return std::nullopt;
}

// ---- header ----

class HeaderReader {
public:
    explicit HeaderReader(const MeshSource& source) : bytes_(source.bytes), lines_(bytes_) {}

    Header read() {
        bool has_format = false;
        std::string_view line;
        lines_.next(line); // "ply"
        while (lines_.next(line)) {
            const std::string_view whole_line = line;
            const std::string_view keyword = take_word(line);
            if (keyword == "end_header") {
                if (!has_format) fail("its header has no format line; add one.");
                header_.body =
                    body_start(static_cast<std::size_t>(whole_line.data() - bytes_.data()) + whole_line.size());
                return std::move(header_);
            }
            if (keyword == "format") {
                read_format(line);
                has_format = true;
            } else if (keyword == "element") {
                read_element(line);
            } else if (keyword == "property") {
                if (header_.elements.empty()) fail_here("a property before the first element; correct the header.");
                read_property(line);
            } else if (keyword != "comment" && keyword != "obj_info" && !keyword.empty()) {
                fail_here(in_quotes(keyword), " is no keyword of a PLY header; the file may be damaged.");
            }
        }
        fail("its header has no end_header line; the file may be cut short.");
    }

private:
    template <class... Parts>
    [[noreturn]] void fail_here(const Parts&... parts) const {
        fail("line ", lines_.line(), ": ", parts...);
    }

    void read_property(std::string_view line) {
        Property property;
        std::string_view word = take_word(line);
        if (word == "list") {
            property.is_list = true;
            word = take_word(line);
            const auto count_type = to_type(word);
            if (!count_type || !is_integer(*count_type))
                fail_here("a list is counted by an integer type, not by ", in_quotes(word), "; correct the header.");
            property.count_type = *count_type;
            word = take_word(line);
        }
        const auto type = to_type(word);
        if (!type) fail_here(in_quotes(word), " is no type of PLY; correct the header.");
        property.type = *type;
        property.name = take_word(line);
        if (property.name.empty()) fail_here("the property has no name; give it one.");
        header_.elements.back().properties.push_back(std::move(property));
    }

    void read_element(std::string_view line) {
        Element element;
        element.name = take_word(line);
        const std::string_view count = take_word(line);
        const char* last = count.data() + count.size();
        const auto [end, error] = std::from_chars(count.data(), last, element.count);
        if (element.name.empty() || error != std::errc() || end != last)
            fail_here("an element needs a name and a count of 0 or more, not ", in_quotes(count), ".");
        header_.elements.push_back(std::move(element));
    }

    void read_format(std::string_view line) {
        const std::string_view name = take_word(line), version = take_word(line);
        if (version != "1.0") fail_here("version ", in_quotes(version), " of PLY is unknown; expected 1.0.");
        if (name == "ascii") header_.order = std::nullopt;
        else if (name == "binary_little_endian") header_.order = std::endian::little;
        else if (name == "binary_big_endian") header_.order = std::endian::big;
        else
            fail_here("the format ", in_quotes(name),
                      " is unknown; expected ascii, binary_little_endian or binary_big_endian.");
    }

    // The byte after end_header's newline. A CR before an LF belongs to it unless the header's lines end in a lone CR:
    // then the LF is already data.
    std::size_t body_start(std::size_t line_end) const {
        const std::size_t first_newline = bytes_.find_first_of("\r\n");
        const bool has_lone_cr = bytes_[first_newline] == '\r' && bytes_.substr(first_newline, 2) != "\r\n";
        if (!has_lone_cr && bytes_.substr(line_end, 2) == "\r\n") return line_end + 2;
        return std::min(line_end + 1, bytes_.size());
    }

    std::string_view bytes_;
    LineScanner lines_;
    Header header_;
};

// ---- bodies: the same few operations on text and on bytes ----

// Why a value cannot be read.
struct BadValue {
    std::string why;
};

std::int64_t to_index(double number) {
    constexpr double largest = 9.0e15; // beyond this no index is valid, and the conversion would be undefined
    if (!(std::abs(number) <= largest) || number != std::floor(number))
        throw BadValue{"an index is not a whole number"};
    return static_cast<std::int64_t>(number);
}

class AsciiBody {
public:
    AsciiBody(std::string_view bytes, const Header& header) : words_(bytes, false, header.body) {}

    // The fewest bytes a value can take: a digit and the space before the next.
    static std::size_t min_size(ValueType) { return 2; }

    double real(ValueType) {
        double value = 0;
        return parsed(value);
    }
    std::int64_t integer(ValueType type) {
        if (!is_integer(type)) return to_index(real(type));
        std::int64_t value = 0;
        return parsed(value);
    }
    void skip(ValueType, std::uint64_t count) {
        for (; count > 0; --count) word();
    }
    // One more than there are, as the last value needs no space behind it.
    std::size_t remaining() const { return words_.remaining() + 1; }
    std::size_t position() const { return words_.position(); }
    std::string where() const { return text_of("line ", words_.line()); }
    bool has_rest() { return !words_.next().empty(); }

private:
    std::string_view word() {
        const std::string_view word = words_.next();
        if (word.empty()) throw BadValue{"the file ends there"};
        return word;
    }
    template <class Value>
    Value parsed(Value value) {
        const std::string_view number = word();
        if (!to_number(number, value)) throw BadValue{in_quotes(number) + " is no number of its type"};
        return value;
    }

    WordScanner words_;
};

class BinaryBody {
public:
    BinaryBody(std::string_view bytes, const Header& header)
        : bytes_(bytes), position_(header.body), order_(*header.order) {}

    static std::size_t min_size(ValueType type) { return byte_size(type); }

    double real(ValueType type) { return get<double>(type); }
    std::int64_t integer(ValueType type) {
        return is_integer(type) ? get<std::int64_t>(type) : to_index(get<double>(type));
    }
    void skip(ValueType type, std::uint64_t count) {
        if (count > remaining() / byte_size(type)) throw BadValue{"the file ends there"};
        position_ += count * byte_size(type);
    }
    std::size_t remaining() const { return bytes_.size() - position_; }
    std::size_t position() const { return position_; }
    std::string where() const { return text_of("byte ", position_); }
    bool has_rest() const { return remaining() > 0; }

private:
    template <class Value>
    Value get(ValueType type) {
        const char* const from = bytes_.data() + position_;
        skip(type, 1);
        return with_type(
            type, [&](auto tag) { return static_cast<Value>(load_value<typename decltype(tag)::type>(from, order_)); });
    }

    std::string_view bytes_;
    std::size_t position_;
    std::endian order_;
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
            result.warnings.push_back(text_of("the property ", in_quotes(arrays_[i].name),
                                              " was left out: that of vertex ", *misfits_[i], " is no ",
                                              name_of(arrays_[i].type), ", as the header says."));
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

    ReadResult read() {
        check_elements();
        read_elements();
        faces_.warn();
        if (!face_values_.empty())
            result_.notes.push_back("values of faces were left out: " + listed(face_values_) +
                                    "; those of vertices are kept.");
        return std::move(result_);
    }

private:
    void check_elements() {
        bool has_faces = false;
        for (const Element& element : header_.elements) {
            if (element.name == "vertex") {
                if (vertices_ != nullptr) fail("it has two elements named vertex; remove one.");
                vertices_ = &element;
            }
            if (!is_face_element(element)) continue;
            if (element.count > 0 && index_list(element) == nullptr)
                fail("its element ", in_quotes(element.name), " has no list named vertex_indices; correct the header.");
            has_faces = has_faces || element.count > 0;
        }
        if (vertices_ == nullptr) fail("it has no element named vertex; it is no mesh.");
        if (!has_faces) fail("it has no faces; give a file with a surface, not only with points.");
        if (vertices_->count > std::numeric_limits<Index>::max())
            fail("it claims ", vertices_->count, " vertices, and indices have 32 bits; split the mesh.");
    }

    void read_elements() {
        Body body(source_.bytes, header_);
        bool has_vertices = false;
        // Faces in front of the vertices wait: polygons are cut by their corners' positions.
        std::vector<std::pair<const Element*, Body>> waiting;
        for (const Element& element : header_.elements) {
            check_count(body, element);
            if (&element == vertices_) {
                read_vertices(body, element);
                has_vertices = true;
            } else if (is_face_element(element) && has_vertices) {
                read_faces(body, element);
            } else {
                if (is_face_element(element)) waiting.emplace_back(&element, body);
                skip_element(body, element);
            }
        }
        if (body.has_rest()) result_.warnings.push_back("data behind the last element were ignored.");
        for (auto& [element, start] : waiting) read_faces(start, *element);
    }

    // Before anything is allocated for the element or looped over.
    void check_count(const Body& body, const Element& element) {
        if (element.count == 0) return;
        if (element.properties.empty())
            fail("its element ", in_quotes(element.name), " has no properties; correct the header.");
        std::size_t row = 0;
        for (const Property& property : element.properties)
            row += Body::min_size(property.is_list ? property.count_type : property.type);
        if (element.count > body.remaining() / row)
            fail("it claims ", element.count, " rows of element ", in_quotes(element.name), ", but only ",
                 body.remaining(), " bytes are left for them; the file is cut short or its header is wrong.");
    }

    template <class ReadRow>
    void for_each_row(Body& body, const Element& element, ReadRow&& read_row) {
        for (std::uint64_t row = 0; row < element.count; ++row) {
            source_.report_row(row, body.position(), "reading PLY");
            try {
                read_row(row);
            } catch (const BadValue& bad) {
                fail(body.where(), ": row ", row, " of ", element.count, " of element ", in_quotes(element.name),
                     " cannot be read: ", bad.why, ".");
            }
        }
    }

    void skip_element(Body& body, const Element& element) {
        for_each_row(body, element, [&](std::uint64_t) {
            for (const Property& property : element.properties) skip_property(body, property);
        });
    }

    void skip_property(Body& body, const Property& property) {
        const std::int64_t count = property.is_list ? body.integer(property.count_type) : 1;
        if (count < 0) throw BadValue{"a list has less than 0 values"};
        body.skip(property.type, static_cast<std::uint64_t>(count));
    }

    void read_vertices(Body& body, const Element& element) {
        const VertexLayout layout = vertex_layout(element);
        if (!layout.has({x, y, z})) fail("its vertices have no x, y and z; it is no mesh.");
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
        for_each_row(body, element, [&](std::uint64_t row) {
            for (std::size_t i = 0; i < layout.slots.size(); ++i) {
                const Property& property = element.properties[i];
                if (property.is_list) {
                    skip_property(body, property);
                    continue;
                }
                value[layout.slots[i]] = body.real(property.type);
                if (layout.slots[i] == ignored) arrays.add(i, value[ignored]);
            }
            mesh.positions.emplace_back(value[x], value[y], value[z]);
            check_position(result_.bad, mesh.positions.back(), [&] { return text_of(body.where(), ": vertex ", row); });
            if (has_normals) mesh.normals.emplace_back(value[nx], value[ny], value[nz]);
            if (has_colours) mesh.colours.push_back(colour(layout, value));
            if (has_uvs) mesh.uvs.emplace_back(value[u], value[v]);
        });
        arrays.hand_over(result_);
    }

    glm::vec4 colour(const VertexLayout& layout, const std::array<double, slot_count>& value) const {
        glm::vec4 encoded(1.0f);
        for (int i = 0; i < 4; ++i) {
            const std::size_t slot = static_cast<std::size_t>(red) + static_cast<std::size_t>(i);
            if (layout.present[slot]) encoded[i] = static_cast<float>(value[slot] * layout.scale[slot]);
        }
        return decode_colour(encoded, source_.options.colours);
    }

    void read_faces(Body& body, const Element& element) {
        const Property* indices = index_list(element);
        if (indices == nullptr) return skip_element(body, element); // only where there are no rows
        // Room for the rows that the bytes left can hold as triangles, whatever the count says.
        const std::size_t smallest = Body::min_size(indices->count_type) + 3 * Body::min_size(indices->type);
        result_.mesh.triangles.reserve(result_.mesh.triangles.size() +
                                       std::min<std::uint64_t>(element.count, body.remaining() / smallest));
        for (const Property& property : element.properties)
            if (&property != indices) face_values_.push_back(property.name);
        const FaceVertices vertices{0, vertices_->count};
        const bool is_strip = is_strip_element(element);
        for_each_row(body, element, [&](std::uint64_t row) {
            for (const Property& property : element.properties) {
                if (&property != indices) {
                    skip_property(body, property);
                    continue;
                }
                read_index_list(body, property, row);
                const auto where = [&] { return text_of(body.where(), is_strip ? ": strip " : ": face ", row); };
                if (is_strip) faces_.add_strip(corners_, vertices, true, where);
                else faces_.add_polygon(corners_, vertices, where);
            }
        });
    }

    void read_index_list(Body& body, const Property& property, std::uint64_t row) {
        const std::int64_t count = body.integer(property.count_type);
        if (count < 0 || static_cast<std::uint64_t>(count) > body.remaining() / Body::min_size(property.type))
            fail(body.where(), ": face ", row, " claims ", count, " corners, but only ", body.remaining(),
                 " bytes are left; the file is damaged or cut short.");
        corners_.resize(static_cast<std::size_t>(count));
        for (std::int64_t& corner : corners_) corner = body.integer(property.type);
    }

    const MeshSource& source_;
    const Header& header_;
    const Element* vertices_ = nullptr;
    ReadResult result_;
    FaceCollector faces_{result_};
    std::vector<std::int64_t> corners_;
    std::vector<std::string> face_values_; // names of what faces have beside corners
};

} // namespace

ReadResult read_ply(const MeshSource& source) {
    const Header header = HeaderReader(source).read();
    if (header.order) return BodyReader<BinaryBody>(source, header).read();
    return BodyReader<AsciiBody>(source, header).read();
}

} // namespace unseen::meshio
