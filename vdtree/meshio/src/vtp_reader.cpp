// VTK's XML format for polygons: VTK File Formats, https://docs.vtk.org, "XML File Formats". What lies raw behind the
// XML makes the file no XML, so it is cut off first.
#include <map>
#include <set>

#include <pugixml.hpp>

#include "face_collector.h"
#include "kept_arrays.h"
#include "text_scanner.h"
#include "value_types.h"
#include "vtp_data.h"

namespace unseen::meshio {

namespace {

constexpr std::string_view appended_tag = "<AppendedData";

// What an array of a file may become, all together: files of constant values are compressed that much.
constexpr std::uint64_t most_bytes_a_byte = 100, always_allowed_bytes = std::uint64_t{1} << 30;

// In their order, each once.
class NameList {
public:
    void add(const std::string& name) {
        if (known_.insert(name).second) names_.push_back(name);
    }
    // A note that they were left out, if there are any.
    void tell(const std::string& what, const std::string& more, std::vector<Message>& notes) const {
        if (!names_.empty()) notes.push_back(what + " were left out: " + listed(names_) + more + ".");
    }

private:
    std::vector<std::string> names_;
    std::set<std::string> known_;
};

std::string counted(std::uint64_t count, const char* noun) { return text_of(count, " ", noun, count == 1 ? "" : "s"); }

class VtpReader {
public:
    explicit VtpReader(const MeshSource& source) : source_(source) {}

    ReadResult read() {
        parse();
        const pugi::xml_node file = document_.child("VTKFile");
        if (!file) fail("it has no element VTKFile; it is no file of VTK.");
        check_type(file);
        decoder_.emplace(encoding_of(file), Budget(source_.bytes.size(), most_bytes_a_byte, always_allowed_bytes));
        int pieces = 0;
        for (const pugi::xml_node piece : file.child("PolyData").children("Piece")) read_piece(piece, pieces++);
        finish();
        return std::move(result_);
    }

private:
    struct Cells {
        std::vector<std::int64_t> ends;    // by cell: where its corners end; the next cell's begin there
        std::vector<std::int64_t> corners; // numbers of points, or whatever the file says
    };

    // ---- XML

    void parse() {
        const std::size_t end = std::min(source_.bytes.find(appended_tag), source_.bytes.size());
        xml_ = source_.bytes.substr(0, end);
        if (end < source_.bytes.size()) {
            xml_ += "</VTKFile>";
            find_appended(end);
        }
        // In place: text stays where it stood, so that its lines are known.
        const pugi::xml_parse_result parsed = document_.load_buffer_inplace(
            xml_.data(), xml_.size(), pugi::parse_minimal | pugi::parse_escapes, pugi::encoding_utf8);
        if (parsed.status == pugi::status_out_of_memory) throw std::bad_alloc();
        if (!parsed)
            fail("line ", line_number(source_.bytes, static_cast<std::size_t>(parsed.offset)), ": it is no XML (",
                 parsed.description(), "); the file is cut short or damaged.");
    }

    void find_appended(std::size_t tag) {
        const std::string_view rest = source_.bytes.substr(tag);
        const std::size_t end = rest.find('>');
        if (end == rest.npos) fail("it ends within its AppendedData; the file is cut short.");
        std::string element(rest.substr(0, end));
        element += "/>";
        pugi::xml_document appended;
        const bool is_xml = static_cast<bool>(
            appended.load_buffer_inplace(element.data(), element.size(), pugi::parse_minimal, pugi::encoding_utf8));
        const std::string_view encoding = appended.first_child().attribute("encoding").value();
        if (!is_xml || (encoding != "raw" && encoding != "base64"))
            fail_unsupported("its AppendedData are ", in_quotes(encoding), ", which is neither raw nor base64.");
        std::size_t begin = end + 1;
        while (begin < rest.size() && is_space(rest[begin])) ++begin;
        if (begin >= rest.size() || rest[begin] != '_')
            fail("its AppendedData do not begin with an underscore; the file is cut short or damaged.");
        appended_ = rest.substr(begin + 1);
        is_appended_base64_ = encoding == "base64";
    }

    // Where a node stands, for messages.
    std::string place_of(pugi::xml_node node) const {
        const auto at = static_cast<std::size_t>(std::max<std::ptrdiff_t>(node.offset_debug(), 0));
        return text_of("line ", line_number(source_.bytes, at), ": ");
    }

    std::uint64_t number(pugi::xml_node node, const char* name, std::uint64_t otherwise) const {
        const pugi::xml_attribute attribute = node.attribute(name);
        std::uint64_t value = otherwise;
        if (attribute && !parse_value(trimmed(attribute.value()), value))
            fail(place_of(node), name, " is ", in_quotes(attribute.value()), ", which is no number of 0 or more.");
        return value;
    }

    void check_type(pugi::xml_node file) const {
        const std::string_view type = file.attribute("type").value();
        if (type != "PolyData")
            fail_unsupported(
                place_of(file), "it holds ", in_quotes(type),
                ", and only PolyData is read; in ParaView use Extract Surface, and save the result as .vtp.");
    }

    VtpEncoding encoding_of(pugi::xml_node file) const {
        VtpEncoding encoding;
        const std::string_view order = file.attribute("byte_order").value(),
                               headers = file.attribute("header_type").value();
        if (order == "BigEndian") encoding.order = std::endian::big;
        else if (order != "LittleEndian" && !order.empty())
            fail(place_of(file), "its byte_order is ", in_quotes(order),
                 ", which is neither LittleEndian nor BigEndian.");
        encoding.has_wide_headers = headers == "UInt64";
        if (!encoding.has_wide_headers && headers != "UInt32" && !headers.empty())
            fail(place_of(file), "its header_type is ", in_quotes(headers), ", which is neither UInt32 nor UInt64.");
        encoding.compressor = file.attribute("compressor").value();
        return encoding;
    }

    // ---- arrays

    // With the place in front of what is wrong.
    VertexArray read_array(pugi::xml_node node, std::uint64_t tuples) {
        try {
            return decode_array(node, tuples);
        } catch (Fault& fault) {
            if (fault.code != ErrorCode::cancelled)
                fault.what = place_of(node) + "array " + in_quotes(node.attribute("Name").value()) + ": " + fault.what;
            throw;
        }
    }

    VertexArray decode_array(pugi::xml_node node, std::uint64_t tuples) {
        const auto type = vtp_type(node.attribute("type").value());
        if (!type) fail("its type ", in_quotes(node.attribute("type").value()), " is no type of numbers.");
        const std::uint64_t components = number(node, "NumberOfComponents", 1);
        VertexArray array{.name = node.attribute("Name").value(), .type = *type};
        if (components < 1 || components > std::numeric_limits<std::uint32_t>::max() ||
            tuples > std::numeric_limits<std::uint64_t>::max() / (components * byte_size(*type)))
            fail(tuples, " values of ", components, " components are no usable numbers; the file is damaged.");
        array.components = static_cast<std::uint32_t>(components);
        const auto decode = [&](std::string_view data, bool is_base64) {
            array.values = decoder_->decode(data, is_base64, tuples * components * byte_size(*type));
            change_order(array.values, byte_size(*type), decoder_->encoding().order);
        };
        const std::string_view format = node.attribute("format").value();
        if (format == "appended") {
            const std::uint64_t offset = number(node, "offset", 0);
            if (offset > appended_.size())
                fail("it begins ", offset, " bytes behind the underscore, where there are ", appended_.size(),
                     "; the file is cut short or damaged.");
            decode(appended_.substr(offset), is_appended_base64_);
        } else if (format == "binary") {
            decode(node.text().get(), true);
        } else if (format == "ascii" || format.empty()) {
            array.values = parse_values(node.text().get(), *type, tuples * components);
        } else {
            fail("its format is ", in_quotes(format), ", which is neither ascii, binary nor appended.");
        }
        done_ += array.values.size();
        source_.report(done_, "reading VTP");
        return array;
    }

    static std::vector<std::byte> parse_values(std::string_view text, ValueType type, std::uint64_t count) {
        std::vector<std::byte> values;
        if (count > text.size() / 2 + 1) fail("it should have ", count, " values, for which its text is too short.");
        values.reserve(count * byte_size(type));
        WordScanner words(text, false);
        with_type(type, [&](auto tag) {
            for (std::uint64_t i = 0; i < count; ++i) {
                typename decltype(tag)::type value{};
                const std::string_view word = words.next();
                if (word.empty()) fail("it ends after ", i, " of ", count, " values.");
                if (!parse_value(word, value))
                    fail("value ", i, " is ", in_quotes(word), ", which is no ", name_of(type), ".");
                append_value(values, value);
            }
        });
        if (!words.next().empty()) fail("it has more than the ", count, " values that it should.");
        return values;
    }

    std::vector<std::int64_t> read_numbers(pugi::xml_node cells, const char* name, std::uint64_t count) {
        pugi::xml_node node = cells.find_child_by_attribute("DataArray", "Name", name);
        if (!node) fail(place_of(cells), "it has no array ", in_quotes(name), "; the file is damaged.");
        const VertexArray array = read_array(node, count);
        if (!is_integer(array.type) || array.components != 1)
            fail(place_of(node), "array ", in_quotes(name), " must be of single whole numbers.");
        return whole_numbers(array);
    }

    // ---- pieces

    Cells read_cells(pugi::xml_node piece, const char* name, std::uint64_t count) {
        Cells cells;
        if (count == 0) return cells;
        const pugi::xml_node node = piece.child(name);
        if (!node) fail(place_of(piece), "it has no ", name, "; the file is damaged.");
        cells.ends = read_numbers(node, "offsets", count);
        if (cells.ends.back() < 0)
            fail(place_of(node), "the last of its offsets is ", cells.ends.back(), "; the file is damaged.");
        cells.corners = read_numbers(node, "connectivity", static_cast<std::uint64_t>(cells.ends.back()));
        return cells;
    }

    void read_piece(pugi::xml_node node, int number_of_piece) {
        const bool is_only = number_of_piece == 0 && !node.next_sibling("Piece");
        const std::string name = is_only ? std::string() : text_of("piece ", number_of_piece, ": ");
        const std::uint64_t count = number(node, "NumberOfPoints", 0);
        VertexArray points;
        points.components = 3;
        if (count > 0) {
            const pugi::xml_node array = node.child("Points").child("DataArray");
            if (!array) fail(place_of(node), "it has no Points; the file is damaged.");
            points = read_array(array, count);
            if (points.components != 3)
                fail(place_of(array), "its points must have 3 components, not ", points.components, ".");
        }
        read_data(node.child("PointData"), count);
        for (const pugi::xml_node array : node.child("CellData").children())
            cell_arrays_.add(array.attribute("Name").value());
        vertex_cells_ += number(node, "NumberOfVerts", 0);
        lines_ += number(node, "NumberOfLines", 0);
        const Cells polygons = read_cells(node, "Polys", number(node, "NumberOfPolys", 0));
        const Cells strips = read_cells(node, "Strips", number(node, "NumberOfStrips", 0));
        const FaceVertices vertices = add_points(name, std::move(points));
        add_cells(name, polygons, vertices, false);
        add_cells(name, strips, vertices, true);
    }

    FaceVertices add_points(const std::string& piece, VertexArray points) {
        Mesh& mesh = result_.mesh;
        const std::size_t first = mesh.positions.size(), count = points.size();
        if (count > std::numeric_limits<Index>::max() - first)
            fail_unsupported("it has more points than 32-bit indices can number; split the mesh.");
        if (first == 0) mesh.positions.reserve(count); // later ones let it grow: there may be very many
        for (std::size_t i = 0; i < count; ++i) {
            mesh.positions.emplace_back(points.number(i, 0), points.number(i, 1), points.number(i, 2));
            check_position(result_.bad, mesh.positions.back(), [&] { return text_of(piece, "point ", i); });
        }
        return {first, count};
    }

    void add_cells(const std::string& piece, const Cells& cells, const FaceVertices& vertices, bool are_strips) {
        const std::span<const std::int64_t> corners = cells.corners;
        std::size_t begin = 0;
        for (std::size_t i = 0; i < cells.ends.size(); ++i) {
            source_.report_row(i, source_.bytes.size(), "reading VTK");
            const auto where = [&] { return text_of(piece, are_strips ? "strip " : "polygon ", i); };
            const std::int64_t end = cells.ends[i];
            if (end < static_cast<std::int64_t>(begin) || static_cast<std::uint64_t>(end) > corners.size())
                fail(where(), " ends at corner ", end, ", but it begins at ", begin, " and there are ", corners.size(),
                     "; the file is damaged.");
            const auto of_cell = corners.subspan(begin, static_cast<std::size_t>(end) - begin);
            if (are_strips) faces_.add_strip(of_cell, vertices, false, where);
            else faces_.add_polygon(of_cell, vertices, where);
            begin = static_cast<std::size_t>(end);
        }
    }

    // ---- data of points

    // Pieces are parts of one mesh: what one of them has not is no array of the whole.
    void read_data(pugi::xml_node node, std::uint64_t points) {
        std::vector<VertexArray> data;
        for (const pugi::xml_node array : node.children()) {
            if (std::string_view(array.name()) == "DataArray" && vtp_type(array.attribute("type").value()))
                data.push_back(read_array(array, points));
            else other_arrays_.add(array.attribute("Name").value());
        }
        if (points == 0) return;
        if (!std::exchange(has_pieces_, true)) {
            data_ = std::move(data);
            marks_ = node;
            return;
        }
        std::map<std::string_view, const VertexArray*> by_name;
        for (const VertexArray& array : data) by_name.try_emplace(array.name, &array);
        std::erase_if(data_, [&](VertexArray& array) {
            const auto found = by_name.find(array.name);
            const bool is_there = found != by_name.end() && found->second->type == array.type &&
                                  found->second->components == array.components;
            if (is_there) {
                const auto& more = found->second->values;
                array.values.insert(array.values.end(), more.begin(), more.end());
                by_name.erase(found);
            } else partial_arrays_.add(array.name);
            return !is_there;
        });
        for (const auto& [name, array] : by_name) partial_arrays_.add(std::string(name));
    }

    // Gives the mesh the values of an array of those that can have the role: of the one that is marked, else of the
    // first that is named so.
    template <class CanBe, class IsNamed, class Vector, class Make>
    void take(VertexArray::Role role, const char* mark, CanBe&& can_be, IsNamed&& is_named, std::vector<Vector>& to,
              Make&& make) {
        const std::string_view marked = marks_.attribute(mark).value();
        auto found = std::ranges::find_if(
            data_, [&](const VertexArray& array) { return !marked.empty() && array.name == marked && can_be(array); });
        if (found == data_.end())
            found = std::ranges::find_if(
                data_, [&](const VertexArray& array) { return is_named(array.name) && can_be(array); });
        if (found == data_.end()) return;
        for (std::size_t v = 0; v < found->size(); ++v)
            to.push_back(make([&](std::uint32_t k) { return found->number(v, k); }, found->components));
        found->role = role;
        found->values = {};
    }

    void give_roles() {
        using Role = VertexArray::Role;
        const auto is_real = [](std::uint32_t components) {
            return [=](const VertexArray& a) { return !is_integer(a.type) && a.components == components; };
        };
        Mesh& mesh = result_.mesh;
        take(
            Role::normals, "Normals", is_real(3),
            [](std::string_view name) { return equals_ignoring_case(name, "normals"); }, mesh.normals,
            [](auto&& value, std::uint32_t) { return glm::vec3(value(0), value(1), value(2)); });
        take(
            Role::uvs, "TCoords", is_real(2),
            [](std::string_view name) {
                return equals_ignoring_case(name, "tcoords") || equals_ignoring_case(name, "texture coordinates");
            },
            mesh.uvs, [](auto&& value, std::uint32_t) { return glm::vec2(value(0), value(1)); });
        take(
            Role::colours, "Scalars",
            [](const VertexArray& a) { return a.type == ValueType::uint8 && (a.components == 3 || a.components == 4); },
            is_colour_name, mesh.colours,
            [&](auto&& value, std::uint32_t components) {
                glm::vec4 colour(1);
                for (std::uint32_t k = 0; k < components; ++k)
                    colour[static_cast<int>(k)] = static_cast<float>(value(k) / 255.0);
                return decode_colour(colour, source_.options.colours);
            });
    }

    void finish() {
        faces_.warn();
        if (vertex_cells_ + lines_ > 0)
            result_.warnings.push_back(counted(vertex_cells_, "vertex cell") + " and " + counted(lines_, "line") +
                                       " were left out: only polygons and triangle strips are kept.");
        cell_arrays_.tell("values of cells", "; those of points are kept", result_.notes);
        other_arrays_.tell("arrays of text, of bits and of other lengths than the points'", "", result_.notes);
        partial_arrays_.tell("arrays that not all pieces have alike", "", result_.notes);
        give_roles();
        keep_arrays(result_, std::move(data_));
    }

    const MeshSource& source_;
    ReadResult result_;
    FaceCollector faces_{result_};
    std::string xml_; // the document points into it
    pugi::xml_document document_;
    std::string_view appended_; // from behind the underscore to the end of the file
    bool is_appended_base64_ = false;
    std::optional<VtpDecoder> decoder_;
    std::uint64_t done_ = 0; // bytes of arrays, for the progress
    std::uint64_t vertex_cells_ = 0, lines_ = 0;
    bool has_pieces_ = false; // with points
    std::vector<VertexArray> data_;
    pugi::xml_node marks_; // says which arrays are scalars, normals and texture coordinates
    NameList cell_arrays_, other_arrays_, partial_arrays_;
};

} // namespace

bool is_vtk_xml(std::string_view bytes) {
    constexpr std::size_t preamble = 4096; // declarations and comments may come first
    const std::string_view start = bytes.substr(0, preamble);
    return trimmed(start).starts_with('<') && start.find("<VTKFile") != start.npos;
}

ReadResult read_vtp(const MeshSource& source) { return VtpReader(source).read(); }

} // namespace unseen::meshio
