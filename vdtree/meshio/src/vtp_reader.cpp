// VTK's XML format for polygons: VTK File Formats, https://docs.vtk.org, "XML File Formats". What lies raw behind the
// XML makes the file no XML, so it is cut off first.
#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <pugixml.hpp>

#include "kept_arrays.h"
#include "mesh_readers.h"
#include "text_scanner.h"
#include "value_types.h"
#include "vtp_data.h"
#include "vtp_polygons.h"
#include "vtp_types.h"

namespace unseen::meshio {

namespace {

constexpr std::string_view appended_tag = "<AppendedData";

// What an array of a file may become, all together: files of constant values are compressed that much.
constexpr std::uint64_t most_bytes_a_byte = 100, always_allowed_bytes = std::uint64_t{1} << 30;

class VtpReader {
public:
    explicit VtpReader(const MeshSource& source) : source_(source), polygons_(source) {}

    ReadResult read() {
        parse();
        const pugi::xml_node file = document_.child("VTKFile");
        if (!file) throw VtkFault{"it has no element VTKFile; it is no file of VTK."};
        check_type(file);
        decoder_.emplace(encoding_of(file), Budget(source_.bytes.size(), most_bytes_a_byte, always_allowed_bytes));
        int pieces = 0;
        for (const pugi::xml_node piece : file.child("PolyData").children("Piece")) read_piece(piece, pieces++);
        return polygons_.finish();
    }

private:
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
            throw VtkFault{"line " +
                           std::to_string(line_number(source_.bytes, static_cast<std::size_t>(parsed.offset))) +
                           ": it is no XML (" + parsed.description() + "); the file is cut short or damaged."};
    }

    void find_appended(std::size_t tag) {
        const std::string_view rest = source_.bytes.substr(tag);
        const std::size_t end = rest.find('>');
        if (end == rest.npos) throw VtkFault{"it ends within its AppendedData; the file is cut short."};
        std::string element(rest.substr(0, end));
        element += "/>";
        pugi::xml_document appended;
        const bool is_xml = static_cast<bool>(
            appended.load_buffer_inplace(element.data(), element.size(), pugi::parse_minimal, pugi::encoding_utf8));
        const std::string_view encoding = appended.first_child().attribute("encoding").value();
        if (!is_xml || (encoding != "raw" && encoding != "base64"))
            throw VtkFault{"its AppendedData are " + in_quotes(encoding) + ", which is neither raw nor base64.",
                           ErrorCode::unsupported};
        std::size_t begin = end + 1;
        while (begin < rest.size() && is_space(rest[begin])) ++begin;
        if (begin >= rest.size() || rest[begin] != '_')
            throw VtkFault{"its AppendedData do not begin with an underscore; the file is cut short or damaged."};
        appended_ = rest.substr(begin + 1);
        is_appended_base64_ = encoding == "base64";
    }

    std::string place_of(pugi::xml_node node) const {
        const auto at = static_cast<std::size_t>(std::max<std::ptrdiff_t>(node.offset_debug(), 0));
        return "line " + std::to_string(line_number(source_.bytes, at)) + ": ";
    }

    std::uint64_t number(pugi::xml_node node, const char* name, std::uint64_t otherwise) const {
        const pugi::xml_attribute attribute = node.attribute(name);
        std::uint64_t value = otherwise;
        if (attribute && !parse_value(trimmed(attribute.value()), value))
            throw VtkFault{place_of(node) + name + " is " + in_quotes(attribute.value()) +
                           ", which is no number of 0 or more."};
        return value;
    }

    void check_type(pugi::xml_node file) const {
        const std::string_view type = file.attribute("type").value();
        if (type == "PolyData") return;
        throw VtkFault{place_of(file) + "it holds " + in_quotes(type) +
                           ", and only PolyData is read; in ParaView use Extract Surface, and save the result as .vtp.",
                       ErrorCode::unsupported};
    }

    VtpEncoding encoding_of(pugi::xml_node file) const {
        VtpEncoding encoding;
        const std::string_view order = file.attribute("byte_order").value(),
                               headers = file.attribute("header_type").value();
        if (order == "BigEndian") encoding.order = std::endian::big;
        else if (order != "LittleEndian" && !order.empty())
            throw VtkFault{place_of(file) + "its byte_order is " + in_quotes(order) +
                           ", which is neither LittleEndian nor BigEndian."};
        encoding.has_wide_headers = headers == "UInt64";
        if (!encoding.has_wide_headers && headers != "UInt32" && !headers.empty())
            throw VtkFault{place_of(file) + "its header_type is " + in_quotes(headers) +
                           ", which is neither UInt32 nor UInt64."};
        encoding.compressor = file.attribute("compressor").value();
        return encoding;
    }

    // ---- arrays

    // With the place in front of what is wrong.
    VertexArray read_array(pugi::xml_node node, std::uint64_t tuples) {
        try {
            return decode_array(node, tuples);
        } catch (VtkFault& fault) {
            if (fault.code != ErrorCode::cancelled)
                fault.what = place_of(node) + "array " + in_quotes(node.attribute("Name").value()) + ": " + fault.what;
            throw;
        }
    }

    VertexArray decode_array(pugi::xml_node node, std::uint64_t tuples) {
        const auto type = vtp_type(node.attribute("type").value());
        if (!type) throw VtkFault{"its type " + in_quotes(node.attribute("type").value()) + " is no type of numbers."};
        const std::uint64_t components = number(node, "NumberOfComponents", 1);
        VertexArray array{.name = node.attribute("Name").value(), .type = *type};
        if (components < 1 || components > std::numeric_limits<std::uint32_t>::max() ||
            tuples > std::numeric_limits<std::uint64_t>::max() / (components * byte_size(*type)))
            throw VtkFault{std::to_string(tuples) + " values of " + std::to_string(components) +
                           " components are no usable numbers; the file is damaged."};
        array.components = static_cast<std::uint32_t>(components);
        const std::uint64_t values = tuples * components;
        const std::string_view format = node.attribute("format").value();
        if (format == "appended") {
            const std::uint64_t offset = number(node, "offset", 0);
            if (offset > appended_.size())
                throw VtkFault{"it begins " + std::to_string(offset) +
                               " bytes behind the underscore, where there are " + std::to_string(appended_.size()) +
                               "; the file is cut short or damaged."};
            array.values = decoder_->decode(appended_.substr(offset), is_appended_base64_, values * byte_size(*type));
            change_order(array.values, byte_size(*type), decoder_->encoding().order);
        } else if (format == "binary") {
            array.values = decoder_->decode(node.text().get(), true, values * byte_size(*type));
            change_order(array.values, byte_size(*type), decoder_->encoding().order);
        } else if (format == "ascii" || format.empty()) {
            array.values = parse_values(node.text().get(), *type, values);
        } else {
            throw VtkFault{"its format is " + in_quotes(format) + ", which is neither ascii, binary nor appended."};
        }
        done_ += array.values.size();
        if (!source_.keep_going(done_, "reading VTP")) throw VtkFault{{}, ErrorCode::cancelled};
        return array;
    }

    static std::vector<std::byte> parse_values(std::string_view text, ValueType type, std::uint64_t count) {
        std::vector<std::byte> values;
        if (count > text.size() / 2 + 1)
            throw VtkFault{"it should have " + std::to_string(count) + " values, for which its text is too short."};
        values.reserve(count * byte_size(type));
        WordScanner words(text, false);
        with_type(type, [&](auto tag) {
            for (std::uint64_t i = 0; i < count; ++i) {
                typename decltype(tag)::type value{};
                const std::string_view word = words.next();
                if (word.empty())
                    throw VtkFault{"it ends after " + std::to_string(i) + " of " + std::to_string(count) + " values."};
                if (!parse_value(word, value))
                    throw VtkFault{"value " + std::to_string(i) + " is " + in_quotes(word) + ", which is no " +
                                   name_of(type) + "."};
                append_value(values, value);
            }
        });
        if (const std::string_view more = words.next(); !more.empty())
            throw VtkFault{"it has more than the " + std::to_string(count) + " values that it should."};
        return values;
    }

    std::vector<std::int64_t> read_numbers(pugi::xml_node cells, const char* name, std::uint64_t count) {
        pugi::xml_node node = cells.find_child_by_attribute("DataArray", "Name", name);
        if (!node) throw VtkFault{place_of(cells) + "it has no array " + in_quotes(name) + "; the file is damaged."};
        const VertexArray array = read_array(node, count);
        if (!is_integer(array.type) || array.components != 1)
            throw VtkFault{place_of(node) + "array " + in_quotes(name) + " must be of single whole numbers."};
        return whole_numbers(array);
    }

    // ---- pieces

    VtkCells read_cells(pugi::xml_node piece, const char* name, std::uint64_t count) {
        VtkCells cells;
        if (count == 0) return cells;
        const pugi::xml_node node = piece.child(name);
        if (!node) throw VtkFault{place_of(piece) + "it has no " + name + "; the file is damaged."};
        cells.ends = read_numbers(node, "offsets", count);
        if (cells.ends.back() < 0)
            throw VtkFault{place_of(node) + "the last of its offsets is " + std::to_string(cells.ends.back()) +
                           "; the file is damaged."};
        cells.corners = read_numbers(node, "connectivity", static_cast<std::uint64_t>(cells.ends.back()));
        return cells;
    }

    void read_piece(pugi::xml_node node, int number_of_piece) {
        VtkPiece piece;
        if (number_of_piece > 0 || node.next_sibling("Piece"))
            piece.name = "piece " + std::to_string(number_of_piece) + ": ";
        const std::uint64_t points = number(node, "NumberOfPoints", 0);
        piece.points.components = 3;
        if (points > 0) {
            const pugi::xml_node array = node.child("Points").child("DataArray");
            if (!array) throw VtkFault{place_of(node) + "it has no Points; the file is damaged."};
            piece.points = read_array(array, points);
            if (piece.points.components != 3)
                throw VtkFault{place_of(array) + "its points must have 3 components, not " +
                               std::to_string(piece.points.components) + "."};
        }
        read_data(node.child("PointData"), points, piece);
        for (const pugi::xml_node array : node.child("CellData").children())
            piece.cell_arrays.emplace_back(array.attribute("Name").value());
        piece.vertex_cells = number(node, "NumberOfVerts", 0);
        piece.lines = number(node, "NumberOfLines", 0);
        piece.polygons = read_cells(node, "Polys", number(node, "NumberOfPolys", 0));
        piece.strips = read_cells(node, "Strips", number(node, "NumberOfStrips", 0));
        polygons_.add(std::move(piece));
    }

    void read_data(pugi::xml_node node, std::uint64_t points, VtkPiece& piece) {
        piece.scalars = node.attribute("Scalars").value();
        piece.normals = node.attribute("Normals").value();
        piece.uvs = node.attribute("TCoords").value();
        for (const pugi::xml_node array : node.children())
            if (std::string_view(array.name()) == "DataArray" && vtp_type(array.attribute("type").value()))
                piece.data.push_back(read_array(array, points));
            else piece.other_arrays.emplace_back(array.attribute("Name").value());
    }

    const MeshSource& source_;
    VtkPolygons polygons_;
    std::string xml_; // the document points into it
    pugi::xml_document document_;
    std::string_view appended_; // from behind the underscore to the end of the file
    bool is_appended_base64_ = false;
    std::optional<VtpDecoder> decoder_;
    std::uint64_t done_ = 0; // bytes of arrays, for the progress
};

} // namespace

bool is_vtk_xml(std::string_view bytes) {
    constexpr std::size_t preamble = 4096; // declarations and comments may come first
    const std::string_view start = bytes.substr(0, preamble);
    return trimmed(start).starts_with('<') && start.find("<VTKFile") != start.npos;
}

Result<ReadResult> read_vtp(const MeshSource& source) {
    try {
        return VtpReader(source).read();
    } catch (const VtkFault& fault) {
        return error_of(source, fault);
    }
}

} // namespace unseen::meshio
