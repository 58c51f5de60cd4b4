// VTK's legacy format: VTK File Formats, https://docs.vtk.org, "Simple Legacy Formats", with what versions 4.1
// (METADATA) and 5.1 (OFFSETS and CONNECTIVITY) added. Statements are text, and so are numbers after ASCII; after
// BINARY they are big-endian and begin behind the newline of their statement.
#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "kept_arrays.h"
#include "mesh_readers.h"
#include "text_scanner.h"
#include "value_types.h"
#include "vtk_polygons.h"
#include "vtk_types.h"

namespace unseen::meshio {

namespace {

constexpr std::string_view legacy_signature = "# vtk DataFile Version";

std::string lower_case(std::string_view text) {
    std::string lower(text);
    for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return lower;
}

// Names are one word: what cannot stand in one comes as %20.
std::string percent_decoded(std::string_view text) {
    std::string decoded;
    for (std::size_t i = 0; i < text.size(); ++i) {
        unsigned code = 0;
        const bool is_code = text[i] == '%' && i + 2 < text.size() &&
                             std::from_chars(&text[i + 1], &text[i + 1] + 2, code, 16).ptr == &text[i + 1] + 2;
        decoded += is_code ? static_cast<char>(code) : text[i];
        if (is_code) i += 2;
    }
    return decoded;
}

class LegacyVtkReader {
public:
    explicit LegacyVtkReader(const MeshSource& source) : source_(source), polygons_(source) {}

    ReadResult read() {
        read_header();
        for (std::string_view word = next_word(); !word.empty(); word = next_word()) read_statement(std::string(word));
        if (!has_points_) throw VtkFault{"it has no POINTS; the file is cut short."};
        polygons_.add(std::move(piece_));
        return polygons_.finish();
    }

private:
    // ---- words and numbers

    std::string_view rest() const { return source_.bytes.substr(position_); }

    std::string_view next_word() {
        while (position_ < source_.bytes.size() && is_space(source_.bytes[position_])) ++position_;
        std::size_t end = position_;
        while (end < source_.bytes.size() && !is_space(source_.bytes[end])) ++end;
        const std::string_view word = source_.bytes.substr(position_, end - position_);
        position_ = end;
        return word;
    }
    // What is left of the line, which is passed with its newline.
    std::string_view rest_of_line() {
        const std::size_t newline = std::min(rest().find('\n'), rest().size());
        const std::string_view line = rest().substr(0, newline);
        position_ += std::min(newline + 1, rest().size());
        return trimmed(line);
    }
    bool follows(std::string_view lower_word) {
        const std::size_t before = position_;
        const std::string_view word = next_word();
        if (word.size() == lower_word.size() && lower_case(word) == lower_word) return true;
        position_ = before;
        return false;
    }

    [[noreturn]] void fail(const std::string& what) const {
        const std::string place = is_binary_ ? "byte " + std::to_string(position_)
                                             : "line " + std::to_string(line_number(source_.bytes, position_));
        throw VtkFault{place + ": " + what};
    }

    std::string word_of(const char* what) {
        const std::string_view word = next_word();
        if (word.empty()) fail(std::string("it ends where ") + what + " should stand; the file is cut short.");
        return std::string(word);
    }
    std::uint64_t count_of(const char* what) {
        const std::string word = word_of(what);
        std::uint64_t count = 0;
        if (!parse_value<std::uint64_t>(word, count))
            fail(std::string(what) + " is " + in_quotes(word) + ", which is no number of 0 or more.");
        return count;
    }

    // Values in text or bytes; `what` names them for messages. Nothing is allocated that the file cannot hold.
    std::vector<std::byte> values(ValueType type, std::uint64_t count, const std::string& what) {
        if (is_binary_) rest_of_line();
        const std::size_t least = is_binary_ ? byte_size(type) : 2; // a digit and the space before the next
        if (count > (rest().size() + 1) / least)
            fail(what + " should have " + std::to_string(count) + " values, but only " + std::to_string(rest().size()) +
                 " bytes are left; the file is cut short or damaged.");
        std::vector<std::byte> read;
        if (is_binary_) {
            const std::size_t bytes = count * byte_size(type);
            if (bytes > rest().size()) fail(what + " is cut short.");
            const auto* first = reinterpret_cast<const std::byte*>(rest().data());
            read.assign(first, first + bytes);
            change_order(read, byte_size(type), std::endian::big);
            position_ += bytes;
        } else {
            read.reserve(count * byte_size(type));
            with_type(type, [&](auto tag) {
                for (std::uint64_t i = 0; i < count; ++i) {
                    typename decltype(tag)::type value{};
                    const std::string_view word = next_word();
                    if (word.empty())
                        fail(what + " ends after " + std::to_string(i) + " of " + std::to_string(count) +
                             " values; the file is cut short.");
                    if (!parse_value(word, value))
                        fail("value " + std::to_string(i) + " of " + what + " is " + in_quotes(word) +
                             ", which is no " + name_of(type) + ".");
                    append_value(read, value);
                }
            });
        }
        if (!source_.keep_going(position_, "reading VTK")) throw VtkFault{{}, ErrorCode::cancelled};
        return read;
    }

    // ---- header

    void read_header() {
        rest_of_line(); // the version, which nothing depends on
        rest_of_line(); // a title
        const std::string word = word_of("ASCII or BINARY"), mode = lower_case(word);
        if (mode != "ascii" && mode != "binary")
            fail("ASCII or BINARY should stand here, not " + in_quotes(word) + "; the file is damaged.");
        if (!follows("dataset")) fail("DATASET should stand here; the file is damaged or holds no mesh.");
        const std::string kind = word_of("a kind of data set");
        is_binary_ = mode == "binary";
        if (lower_case(kind) == "polydata") return;
        throw VtkFault{"it holds the data set " + in_quotes(kind) +
                           ", and only POLYDATA is read; in ParaView use Extract Surface, and save the result as .vtp.",
                       ErrorCode::unsupported};
    }

    // ---- statements

    enum class Section { geometry, points, cells };

    void read_statement(const std::string& word) {
        const std::string keyword = lower_case(word);
        if (keyword == "points") return read_points();
        if (keyword == "vertices") piece_.vertex_cells += skip_cells();
        else if (keyword == "lines") piece_.lines += skip_cells();
        else if (keyword == "polygons") append_cells(piece_.polygons, read_cells("POLYGONS"));
        else if (keyword == "triangle_strips") append_cells(piece_.strips, read_cells("TRIANGLE_STRIPS"));
        else if (keyword == "point_data") begin_data(Section::points, "POINT_DATA");
        else if (keyword == "cell_data") begin_data(Section::cells, "CELL_DATA");
        else if (keyword == "metadata") skip_metadata(3);
        else if (keyword == "field") read_field();
        else if (section_ == Section::geometry || !read_attribute(keyword))
            fail(in_quotes(word) + " is no statement that can stand here; the file is damaged.");
    }

    void read_points() {
        if (has_points_) fail("it has POINTS twice; the file is damaged.");
        has_points_ = true;
        const std::uint64_t count = count_of("the number of points");
        if (count > std::numeric_limits<Index>::max())
            throw VtkFault{"it has more points than 32-bit indices can number; split the mesh.",
                           ErrorCode::unsupported};
        piece_.points = {.name = "POINTS", .type = number_type(), .components = 3};
        piece_.points.values = values(piece_.points.type, 3 * count, "POINTS");
    }

    ValueType number_type() {
        const std::string word = word_of("a type of numbers");
        const auto type = legacy_type(lower_case(word));
        if (!type) fail(in_quotes(word) + " is no type of numbers.");
        return *type;
    }

    // "N SIZE", then for each cell a number of corners and these; or, from version 5.1 on, N offsets, 0 the first, and
    // SIZE corners.
    VtkCells read_cells(const std::string& what) {
        const std::uint64_t count = count_of("the number of cells"), size = count_of("the size of cells");
        VtkCells cells;
        if (follows("offsets")) {
            const VertexArray offsets{.name = what, .type = number_type(), .values = {}};
            std::vector<std::int64_t> ends = whole(offsets.type, count, what + "'s OFFSETS");
            if (!follows("connectivity")) fail("CONNECTIVITY should stand here; the file is damaged.");
            cells.corners = whole(number_type(), size, what + "'s CONNECTIVITY");
            if (!ends.empty() && ends.front() != 0) fail(what + "'s first offset must be 0.");
            if (!ends.empty()) ends.erase(ends.begin());
            cells.ends = std::move(ends);
            return cells;
        }
        const std::vector<std::int64_t> numbers = whole(ValueType::int32, size, what);
        if (count > size) fail(what + " has more cells than numbers; the file is damaged.");
        cells.ends.reserve(count);
        cells.corners.reserve(size - count);
        std::size_t at = 0;
        for (std::uint64_t i = 0; i < count; ++i) {
            const std::int64_t corners = at < numbers.size() ? numbers[at++] : -1;
            if (corners < 0 || static_cast<std::uint64_t>(corners) > numbers.size() - at)
                fail("cell " + std::to_string(i) + " of " + what + " has " + std::to_string(corners) +
                     " corners, which is less than none or more than there are; the file is damaged.");
            const auto first = numbers.begin() + static_cast<std::ptrdiff_t>(at);
            cells.corners.insert(cells.corners.end(), first, first + corners);
            cells.ends.push_back(static_cast<std::int64_t>(cells.corners.size()));
            at += static_cast<std::size_t>(corners);
        }
        if (at < numbers.size()) fail(what + " has more numbers than its cells; the file is damaged.");
        return cells;
    }
    std::vector<std::int64_t> whole(ValueType type, std::uint64_t count, const std::string& what) {
        if (!is_integer(type)) fail(what + " must be whole numbers.");
        VertexArray array{.name = what, .type = type, .values = values(type, count, what)};
        return whole_numbers(array);
    }
    std::uint64_t skip_cells() { return read_cells("cells").ends.size(); }

    static void append_cells(VtkCells& to, VtkCells more) {
        const auto before = static_cast<std::int64_t>(to.corners.size());
        for (const std::int64_t end : more.ends) to.ends.push_back(before + end);
        to.corners.insert(to.corners.end(), more.corners.begin(), more.corners.end());
    }

    // ---- attributes

    void begin_data(Section section, const char* what) {
        section_ = section;
        tuples_ = count_of("the number of tuples");
        if (section == Section::points && tuples_ != piece_.points.size())
            fail(std::string(what) + " is of " + std::to_string(tuples_) + " points, but there are " +
                 std::to_string(piece_.points.size()) + "; the file is damaged.");
    }

    // False: there is none of that name.
    bool read_attribute(const std::string& keyword) {
        if (keyword == "scalars") read_scalars();
        else if (keyword == "color_scalars") read_colours();
        else if (keyword == "lookup_table") skip_lookup_table();
        else if (keyword == "normals") piece_.normals = read_named(3);
        else if (keyword == "vectors") read_named(3);
        else if (keyword == "tensors") read_named(9);
        else if (keyword == "tensors6") read_named(6);
        else if (keyword == "global_ids" || keyword == "pedigree_ids" || keyword == "edge_flags") read_named(1);
        else if (keyword == "texture_coordinates") {
            const std::string name = percent_decoded(word_of("a name"));
            const std::uint64_t dimension = count_of("the dimension of texture coordinates");
            read_array(name, dimension, tuples_);
            if (section_ == Section::points) piece_.uvs = name;
        } else return false;
        return true;
    }

    // Returns the name.
    std::string read_named(std::uint64_t components) {
        std::string name = percent_decoded(word_of("a name"));
        read_array(name, components, tuples_);
        return name;
    }

    // "SCALARS NAME TYPE [COMPONENTS]", then "LOOKUP_TABLE NAME" and the values.
    void read_scalars() {
        const std::string name = percent_decoded(word_of("a name")), type = lower_case(word_of("a type of numbers"));
        const std::string_view more = rest_of_line();
        std::uint64_t components = 1;
        if (!more.empty() && !parse_value(more, components))
            fail("the number of components is " + in_quotes(more) + ", which is no number of 0 or more.");
        if (!follows("lookup_table")) fail("LOOKUP_TABLE and a name should stand behind SCALARS.");
        word_of("the name of a lookup table");
        read_array_of(name, type, components, tuples_);
        if (section_ == Section::points) piece_.scalars = name;
    }

    // Bytes, or numbers from 0 to 1 in text.
    void read_colours() {
        const std::string name = percent_decoded(word_of("a name"));
        VertexArray array{.name = name, .type = ValueType::uint8, .components = components_of("colours")};
        const std::uint64_t count = value_count(array.components, tuples_, name);
        if (is_binary_) {
            array.values = values(ValueType::uint8, count, in_quotes(name));
        } else {
            VertexArray text{.name = name, .type = ValueType::float64};
            text.values = values(ValueType::float64, count, in_quotes(name));
            for (std::size_t i = 0; i < text.size(); ++i) {
                const double value = text.number(i);
                append_value(array.values,
                             static_cast<std::uint8_t>(value > 0 ? std::lround(std::min(value, 1.0) * 255.0) : 0));
            }
        }
        keep(std::move(array), tuples_);
        if (section_ == Section::points) piece_.scalars = name;
        skip_metadata_behind(array.components);
    }

    void skip_lookup_table() {
        word_of("the name of a lookup table");
        const std::uint64_t colours = count_of("the size of a lookup table");
        values(is_binary_ ? ValueType::uint8 : ValueType::float64, value_count(4, colours, "LOOKUP_TABLE"),
               "LOOKUP_TABLE");
    }

    // "FIELD NAME N", then N times "NAME COMPONENTS TUPLES TYPE" and the values. Before other data it is the file's.
    void read_field() {
        word_of("a name");
        const std::uint64_t arrays = count_of("the number of arrays");
        for (std::uint64_t i = 0; i < arrays; ++i) {
            const std::string name = word_of("a name");
            if (name == "NULL_ARRAY") continue;
            const std::uint64_t components = count_of("the number of components"),
                                tuples = count_of("the number of tuples");
            read_array_of(percent_decoded(name), lower_case(word_of("a type of numbers")), components, tuples);
        }
    }

    std::uint32_t components_of(const char* what) {
        const std::uint64_t components = count_of((std::string("the number of components of ") + what).c_str());
        if (components > std::numeric_limits<std::uint32_t>::max()) fail("that are more components than there can be.");
        return static_cast<std::uint32_t>(components);
    }

    // Not more than any file can hold.
    std::uint64_t value_count(std::uint64_t components, std::uint64_t tuples, const std::string& name) const {
        if (components > 0 && tuples > std::numeric_limits<std::uint32_t>::max() * std::uint64_t{1024} / components)
            fail(in_quotes(name) + " has more values than the file can hold; the file is damaged.");
        return components * tuples;
    }

    void read_array(const std::string& name, std::uint64_t components, std::uint64_t tuples) {
        read_array_of(name, lower_case(word_of("a type of numbers")), components, tuples);
    }

    void read_array_of(const std::string& name, const std::string& type, std::uint64_t components,
                       std::uint64_t tuples) {
        const std::uint64_t count = value_count(components, tuples, name);
        const auto numbers = legacy_type(type);
        if (type == "string") skip_strings(count, name);
        else if (type == "bit") skip_bits(count, name);
        else if (!numbers) fail(in_quotes(type) + " is no type of numbers.");
        if (numbers && components > 0) {
            VertexArray array{.name = name, .type = *numbers, .components = static_cast<std::uint32_t>(components)};
            array.values = values(*numbers, count, in_quotes(name));
            keep(std::move(array), tuples);
        } else if (section_ == Section::points) {
            piece_.other_arrays.push_back(name);
        }
        skip_metadata_behind(components);
    }

    void keep(VertexArray array, std::uint64_t tuples) {
        if (section_ == Section::cells) piece_.cell_arrays.push_back(array.name);
        if (section_ != Section::points) return;
        if (tuples == tuples_ && array.components > 0) piece_.data.push_back(std::move(array));
        else piece_.other_arrays.push_back(array.name);
    }

    void skip_bits(std::uint64_t count, const std::string& name) {
        if (is_binary_) values(ValueType::uint8, (count + 7) / 8, in_quotes(name));
        else values(ValueType::int8, count, in_quotes(name));
    }

    // In text one to a line. In bytes, two bits say how many bytes the length has: 0: 8, 1: 4, 2: 2, 3: 1.
    void skip_strings(std::uint64_t count, const std::string& name) {
        rest_of_line();
        for (std::uint64_t i = 0; i < count; ++i) {
            if (rest().empty()) fail(in_quotes(name) + " ends after " + std::to_string(i) + " texts; it is cut short.");
            if (!is_binary_) {
                rest_of_line();
                continue;
            }
            const auto first = static_cast<unsigned char>(rest().front());
            const std::size_t bytes = std::size_t{8} >> (first >> 6);
            if (bytes > rest().size()) fail(in_quotes(name) + " is cut short.");
            std::uint64_t length = first & 0x3F;
            for (std::size_t k = 1; k < bytes; ++k) length = length << 8 | static_cast<unsigned char>(rest()[k]);
            position_ += bytes;
            if (length > rest().size()) fail(in_quotes(name) + " is cut short.");
            position_ += length;
        }
    }

    // Lines up to an empty one; names of components may be empty.
    void skip_metadata(std::uint64_t components) {
        rest_of_line();
        while (!rest().empty()) {
            const std::string line = lower_case(rest_of_line());
            if (line.empty()) return;
            for (std::uint64_t i = 0; line == "component_names" && i < components && !rest().empty(); ++i)
                rest_of_line();
        }
    }
    void skip_metadata_behind(std::uint64_t components) {
        if (follows("metadata")) skip_metadata(components);
    }

    const MeshSource& source_;
    VtkPolygons polygons_;
    std::size_t position_ = 0;
    bool is_binary_ = false, has_points_ = false;
    Section section_ = Section::geometry;
    std::uint64_t tuples_ = 0; // of the section
    VtkPiece piece_;
};

} // namespace

bool is_legacy_vtk(std::string_view bytes) { return bytes.starts_with(legacy_signature); }

Result<ReadResult> read_legacy_vtk(const MeshSource& source) {
    if (!is_legacy_vtk(source.bytes))
        return malformed_line(
            source, 1, "it does not begin with '" + std::string(legacy_signature) + "'; it is no legacy file of VTK.");
    try {
        return LegacyVtkReader(source).read();
    } catch (const VtkFault& fault) {
        return error_of(source, fault);
    }
}

} // namespace unseen::meshio
