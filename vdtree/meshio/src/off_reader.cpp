// OFF: Geomview's object file format, ASCII, with its prefixes ST, C and N.

#include "face_collector.h"
#include "text_scanner.h"

namespace unseen::meshio {

namespace {

// More numbers than any vertex line has: 3 + 3 normal + 4 colour + 2 UV.
constexpr std::size_t max_extras = 9;
// A row of the shortest kind: "0 0 0\n" for a vertex, "1\n" for a face nobody can draw.
constexpr std::uint64_t min_vertex_bytes = 6;
constexpr std::uint64_t min_face_bytes = 2;

struct Keyword {
    bool is_off = false;
    bool has_uvs = false;
    bool has_colours = false;
    bool has_normals = false;
    bool is_other_dimension = false; // 4OFF, nOFF: no surface in space
};

Keyword parse_keyword(std::string_view word) {
    Keyword keyword;
    const auto take = [&word](std::string_view prefix) {
        if (!word.starts_with(prefix)) return false;
        word.remove_prefix(prefix.size());
        return true;
    };
    keyword.has_uvs = take("ST");
    keyword.has_colours = take("C");
    keyword.has_normals = take("N");
    const bool is_4d = take("4");
    const bool is_nd = take("n");
    keyword.is_other_dimension = is_4d || is_nd;
    keyword.is_off = word == "OFF";
    return keyword;
}

class OffReader {
public:
    explicit OffReader(const MeshSource& source) : source_(source), words_(source.bytes, true) {}

    ReadResult read() {
        read_header();
        read_vertices();
        decode_colours();
        read_faces();
        return std::move(result_);
    }

private:
    void read_header() {
        std::string_view word = words_.next();
        if (const Keyword keyword = parse_keyword(word); keyword.is_off) {
            keyword_ = keyword;
            word = words_.next();
        }
        if (word == "BINARY") fail_unsupported("binary OFF is not read; convert it to ASCII OFF or PLY.");
        if (keyword_.is_other_dimension)
            fail_unsupported("4OFF and nOFF are not read; project it to three dimensions.");
        vertex_count_ = to_count(word, "vertices");
        face_count_ = to_count(words_.next(), "faces");
        // The number of edges is there in most files, and nobody needs it.
        words_.next_in_line();
        const std::uint64_t left = words_.remaining() + 1; // the last line may lack its newline
        if (vertex_count_ > left / min_vertex_bytes || face_count_ > left / min_face_bytes)
            fail("it claims ", vertex_count_, " vertices and ", face_count_, " faces, but only ", words_.remaining(),
                 " bytes are left for them; the file is cut short or its counts are wrong.");
        if (vertex_count_ > std::numeric_limits<Index>::max())
            fail("it has more vertices than 32-bit indices can number; split the mesh.");
    }

    void read_vertices() {
        Mesh& mesh = result_.mesh;
        mesh.positions.reserve(vertex_count_);
        for (std::uint64_t i = 0; i < vertex_count_; ++i) {
            source_.report_row(i, words_.position(), "reading OFF");
            glm::dvec3 p(0.0);
            for (int axis = 0; axis < 3; ++axis) p[axis] = to_real(words_.next(), i);
            mesh.positions.push_back(p);
            check_position(result_.bad, p, [&] { return text_of(line(), "vertex ", i); });
            if (keyword_.has_normals || keyword_.has_colours || keyword_.has_uvs) read_attributes(i);
        }
    }

    // What follows the coordinates on their line: normal, then colour (3 or 4 numbers), then UV.
    void read_attributes(std::uint64_t vertex) {
        std::array<double, max_extras> extra{};
        std::size_t count = 0;
        for (std::string_view word = words_.next_in_line(); !word.empty(); word = words_.next_in_line()) {
            if (count == max_extras) break;
            extra[count++] = to_real(word, vertex);
        }
        words_.skip_line();
        const std::size_t normal_size = keyword_.has_normals ? 3 : 0;
        const std::size_t uv_size = keyword_.has_uvs ? 2 : 0;
        const std::size_t colour_size = count - std::min(count, normal_size + uv_size);
        const bool has_right_count = count >= normal_size + uv_size &&
                                     (keyword_.has_colours ? colour_size == 3 || colour_size == 4 : colour_size == 0);
        if (!has_right_count)
            fail(line(), "vertex ", vertex, " has ", count, " numbers behind its coordinates, which is not what the ",
                 "first line of the file announces; correct one of them.");
        Mesh& mesh = result_.mesh;
        if (keyword_.has_normals) mesh.normals.emplace_back(extra[0], extra[1], extra[2]);
        if (keyword_.has_colours)
            mesh.colours.emplace_back(extra[normal_size], extra[normal_size + 1], extra[normal_size + 2],
                                      colour_size == 4 ? extra[normal_size + 3] : -1.0);
        if (keyword_.has_uvs) mesh.uvs.emplace_back(extra[count - 2], extra[count - 1]);
    }

    // Colours are 0..1 or 0..255, and only all of them together tell which.
    void decode_colours() {
        float largest = 0.0f;
        for (const glm::vec4& c : result_.mesh.colours) largest = std::max({largest, c.r, c.g, c.b, c.a});
        const float full = largest > 1.0f ? 255.0f : 1.0f;
        for (glm::vec4& c : result_.mesh.colours) {
            const bool has_alpha = c.a >= 0.0f;
            c = decode_colour(c / full, source_.options.colours);
            if (!has_alpha) c.a = 1.0f;
        }
    }

    void read_faces() {
        for (std::uint64_t i = 0; i < face_count_; ++i) {
            source_.report_row(i, words_.position(), "reading OFF");
            const std::int64_t size = to_index(words_.next(), i);
            if (size < 0 || static_cast<std::uint64_t>(size) > words_.remaining() / 2)
                fail(line(), "face ", i, " claims ", size, " corners, more than the file can hold; correct it.");
            corners_.resize(static_cast<std::size_t>(size));
            for (std::int64_t& corner : corners_) corner = to_index(words_.next(), i);
            faces_.add_polygon(corners_, {0, vertex_count_}, [&] { return text_of(line(), "face ", i); });
            words_.skip_line(); // a colour may follow
        }
        faces_.warn();
    }

    std::uint64_t to_count(std::string_view word, const char* what) const {
        std::int64_t value = 0;
        if (!to_number(word, value) || value < 0)
            fail(line(), "the number of ", what, " should stand here, not ", in_quotes(word), ".");
        return static_cast<std::uint64_t>(value);
    }

    double to_real(std::string_view word, std::uint64_t vertex) const {
        double value = 0;
        if (!to_number(word, value)) fail_number(word, "vertex ", vertex, vertex_count_);
        return value;
    }

    std::int64_t to_index(std::string_view word, std::uint64_t face) const {
        std::int64_t value = 0;
        if (!to_number(word, value)) fail_number(word, "face ", face, face_count_);
        return value;
    }

    [[noreturn]] void fail_number(std::string_view word, const char* what, std::uint64_t number,
                                  std::uint64_t count) const {
        const std::string where = text_of(what, number, " of ", count);
        if (word.empty()) fail("it ends within ", where, "; the file is cut short.");
        fail(line(), where, " has ", in_quotes(word), " where a number should be; correct it.");
    }

    std::string line() const { return text_of("line ", words_.line(), ": "); }

    const MeshSource& source_;
    WordScanner words_;
    Keyword keyword_;
    std::uint64_t vertex_count_ = 0;
    std::uint64_t face_count_ = 0;
    ReadResult result_;
    FaceCollector faces_{result_};
    std::vector<std::int64_t> corners_;
};

} // namespace

bool starts_with_off_keyword(std::string_view bytes) { return parse_keyword(WordScanner(bytes, true).next()).is_off; }

ReadResult read_off(const MeshSource& source) { return OffReader(source).read(); }

} // namespace unseen::meshio
