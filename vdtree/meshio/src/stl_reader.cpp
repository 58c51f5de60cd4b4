// STL, ASCII and binary. Facets have three vertices of their own, which are welded unless the options say no.

#include "mesh_readers.h"
#include "text_scanner.h"
#include "value_types.h"
#include "weld.h"

namespace unseen::meshio {

namespace {

constexpr std::size_t header_bytes = 80;
constexpr std::size_t preamble_bytes = header_bytes + 4; // and the facet count
constexpr std::size_t facet_bytes = 50;                  // normal, 3 corners, 2 bytes that nobody agrees about
constexpr std::uint64_t max_facets = std::numeric_limits<Index>::max() / 3;

std::uint64_t claimed_facets(std::string_view bytes) {
    return load_value<std::uint32_t>(bytes.data() + header_bytes, std::endian::little);
}

// "solid" and a name, then a facet or the end: some binary files start with "solid" too.
bool is_ascii_stl(std::string_view bytes) {
    WordScanner words(bytes, false);
    if (!equals_ignoring_case(words.next(), "solid")) return false;
    words.skip_line();
    const std::string_view word = words.next();
    return equals_ignoring_case(word, "facet") || equals_ignoring_case(word, "endsolid") ||
           equals_ignoring_case(word, "end");
}

bool is_direction(const glm::vec3& n) { return is_finite(n) && n != glm::vec3(0.0f); }

void add_facet(ReadResult& result, const glm::vec3& normal, const std::array<glm::dvec3, 3>& corners) {
    Mesh& mesh = result.mesh;
    const std::uint64_t facet = result.source_faces++;
    if (!std::all_of(corners.begin(), corners.end(), is_finite<double>)) {
        leave_out_face(result.bad,
                       [&] { return "facet " + std::to_string(facet) + " has a NaN or infinite coordinate"; });
        return;
    }
    const auto first = static_cast<Index>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), corners.begin(), corners.end());
    mesh.normals.insert(mesh.normals.end(), 3, normal);
    mesh.triangles.push_back({first, first + 1, first + 2});
}

// A facet's normal of zero means "compute it" in STL, and so does one that is not finite, which flat facets often have:
// what it was to say follows from the corners.
void settle_normals(ReadResult& result) {
    Mesh& mesh = result.mesh;
    const bool any = std::any_of(mesh.normals.begin(), mesh.normals.end(), is_direction);
    std::uint64_t not_finite = 0; // a facet's three are the same
    for (glm::vec3& normal : mesh.normals) {
        if (is_finite(normal)) continue;
        normal = missing_normal;
        ++not_finite;
    }
    if (not_finite > 0)
        result.warnings.push_back(counted_were(not_finite / 3, "facet normal") +
                                  " not finite and computed from the corners.");
    if (!any) mesh.normals = {};
}

// The normals are the facets', not those of a smooth surface: they go.
void weld(ReadResult& result) {
    Mesh& mesh = result.mesh;
    const std::size_t before = mesh.positions.size();
    std::vector<Index> number = find_first_at_place(mesh.positions);
    std::size_t kept = 0;
    for (std::size_t v = 0; v < before; ++v) {
        if (number[v] == v) {
            mesh.positions[kept] = mesh.positions[v];
            number[v] = static_cast<Index>(kept++);
        } else {
            number[v] = number[number[v]]; // the first one has its new number already
        }
    }
    if (kept == before) return;
    mesh.positions.resize(kept);
    mesh.positions.shrink_to_fit();
    for (Triangle& t : mesh.triangles)
        for (Index& v : t) v = number[v];
    mesh.normals = {};
    result.notes.push_back(
        Message::of("its {} vertices, three a facet, were welded to {}; with {read.weld = false} they "
                    "and the facets' normals stay.",
                    {std::to_string(before), std::to_string(kept)}));
}

void settle(const MeshSource& source, ReadResult& result) {
    settle_normals(result);
    if (source.options.weld) weld(result);
}

[[noreturn]] void fail_facets() {
    fail_unsupported("it has more facets than 32-bit indices can number; split the mesh.");
}

glm::vec3 vector_at(const char* bytes) {
    const auto number = [&](std::size_t i) { return load_value<float>(bytes + 4 * i, std::endian::little); };
    return {number(0), number(1), number(2)};
}

ReadResult read_binary(const MeshSource& source) {
    const std::string_view bytes = source.bytes;
    if (bytes.size() < preamble_bytes) fail("it is too short for an STL file; it may be cut short.");
    const std::uint64_t count = claimed_facets(bytes);
    const std::uint64_t room = (bytes.size() - preamble_bytes) / facet_bytes;
    if (count > room)
        fail("it claims ", count, " facets, but its bytes hold only ", room,
             "; the file is cut short or its count is wrong.");
    if (count > max_facets) fail_facets();

    ReadResult result;
    result.mesh.positions.reserve(3 * count);
    result.mesh.normals.reserve(3 * count);
    result.mesh.triangles.reserve(count);
    for (std::uint64_t i = 0; i < count; ++i) {
        const std::uint64_t at = preamble_bytes + i * facet_bytes;
        source.report_row(i, at, "reading STL");
        const char* facet = bytes.data() + at;
        add_facet(
            result, vector_at(facet),
            {glm::dvec3(vector_at(facet + 12)), glm::dvec3(vector_at(facet + 24)), glm::dvec3(vector_at(facet + 36))});
    }
    if (bytes.size() > preamble_bytes + count * facet_bytes)
        result.warnings.push_back("data behind the last facet were ignored.");
    settle(source, result);
    return result;
}

// "solid NAME" { "facet normal X Y Z outer loop" 3 x "vertex X Y Z" "endloop endfacet" } "endsolid NAME", repeated.
class AsciiReader {
public:
    explicit AsciiReader(const MeshSource& source) : source_(source), words_(source.bytes, false) {}

    ReadResult read() {
        for (std::string_view word = words_.next(); !word.empty(); word = words_.next()) {
            if (!equals_ignoring_case(word, "solid")) fail_at("solid", word);
            read_solid();
        }
        settle(source_, result_);
        return std::move(result_);
    }

private:
    void read_solid() {
        MeshRange range{rest_of_line(), MeshRange::Kind::group, result_.mesh.triangles.size(), 0};
        for (std::string_view word = words_.next(); !ends(word, "solid"); word = words_.next()) {
            if (!equals_ignoring_case(word, "facet")) fail_at("facet or endsolid", word);
            read_facet();
        }
        words_.skip_line();
        range.triangle_count = result_.mesh.triangles.size() - range.first_triangle;
        if (range.triangle_count > 0) result_.mesh.ranges.push_back(std::move(range));
    }

    void read_facet() {
        const std::uint64_t facet = result_.source_faces;
        if (facet >= max_facets) fail_facets();
        source_.report_row(facet, words_.position(), "reading STL");
        expect("normal");
        const glm::dvec3 normal = read_vector();
        expect("outer");
        expect("loop");
        std::array<glm::dvec3, 3> corners{};
        for (glm::dvec3& corner : corners) {
            expect("vertex");
            corner = read_vector();
        }
        for (const char* what : {"loop", "facet"})
            if (const std::string_view word = words_.next(); !ends(word, what))
                fail_at(std::string("end") + what, word);
        add_facet(result_, glm::vec3(normal), corners);
    }

    glm::dvec3 read_vector() {
        glm::dvec3 vector(0.0);
        for (int axis = 0; axis < 3; ++axis) {
            const std::string_view word = words_.next();
            if (!to_number(word, vector[axis])) fail_at("a number", word);
        }
        return vector;
    }

    void expect(std::string_view keyword) {
        const std::string_view word = words_.next();
        if (!equals_ignoring_case(word, keyword)) fail_at(keyword, word);
    }

    // "endsolid", or "end solid" as some programs write it.
    bool ends(std::string_view word, std::string_view what) {
        constexpr std::size_t end = 3;
        if (!equals_ignoring_case(word.substr(0, end), "end")) return false;
        if (word.size() > end) return equals_ignoring_case(word.substr(end), what);
        return equals_ignoring_case(words_.next(), what);
    }

    std::string rest_of_line() {
        const std::size_t first = words_.position();
        words_.skip_line();
        return std::string(trimmed(source_.bytes.substr(first, words_.position() - first)));
    }

    [[noreturn]] void fail_at(std::string_view wanted, std::string_view word) const {
        const std::string where = text_of("facet ", result_.source_faces);
        if (word.empty()) fail("it ends at ", where, " without ", wanted, "; it is cut short.");
        fail("line ", words_.line(), ": ", where, " has ", in_quotes(word), " where ", wanted,
             " should be; correct it.");
    }

    const MeshSource& source_;
    WordScanner words_;
    ReadResult result_;
};

} // namespace

bool is_binary_stl(std::string_view bytes) {
    return bytes.size() >= preamble_bytes && bytes.size() - preamble_bytes == claimed_facets(bytes) * facet_bytes;
}

ReadResult read_stl(const MeshSource& source) {
    if (!is_binary_stl(source.bytes) && is_ascii_stl(source.bytes)) return AsciiReader(source).read();
    return read_binary(source);
}

} // namespace unseen::meshio
