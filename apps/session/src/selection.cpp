#include <unseen/session/internal/selections.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <fstream>
#include <map>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <unseen/vdtree/internal/atomic_file.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/input_file.h>

namespace unseen::session {
namespace {

static_assert(std::endian::native == std::endian::little, "Files of selections are little-endian.");

using Magic = std::array<char, 8>;
constexpr Magic selection_magic = {'U', 'N', 'S', 'E', 'E', 'N', 'S', 'L'};
constexpr Magic journal_magic = {'U', 'N', 'S', 'E', 'E', 'N', 'S', 'J'};
constexpr std::uint32_t selection_version = 2;
constexpr auto any_count = std::numeric_limits<std::uint32_t>::max();

// ---- bytes

// One function says what a file holds, for both to go through: pass() writes, or reads.
class ByteWriter {
public:
    template <class T>
    void pass(const T& value) {
        static_assert(std::is_trivially_copyable_v<T>);
        const auto bytes = std::as_bytes(std::span(&value, 1));
        bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    }
    template <class Count = std::uint32_t, class T>
    void pass_size(const std::vector<T>& values, std::size_t, std::uint64_t, const char*) {
        pass(static_cast<Count>(values.size()));
    }
    void require(bool, const char*) const {}
    bool is_right() const { return true; }
    std::vector<std::byte> take() { return std::move(bytes_); }

private:
    std::vector<std::byte> bytes_;
};

// Every read is checked; after the first that fails, all give 0 and error() tells.
class ByteReader {
public:
    explicit ByteReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

    template <class T>
    void pass(T& value) {
        if (is_right() && bytes_.size() - at_ < sizeof(T)) failure_ = "it ends there, in the middle of a number";
        value = T{};
        if (!is_right()) return;
        std::memcpy(&value, bytes_.data() + at_, sizeof(T));
        at_ += sizeof(T);
    }
    // Of values that are `least_bytes` long each, at least.
    template <class Count = std::uint32_t, class T>
    void pass_size(std::vector<T>& values, std::size_t least_bytes, std::uint64_t most, const char* what) {
        Count count = 0;
        pass(count);
        if (is_right() && (count > most || count > (bytes_.size() - at_) / least_bytes))
            failure_ = "it says that there are " + std::to_string(count) + " " + what + ", more than it has room for";
        values.resize(is_right() ? count : 0);
    }
    void require(bool is_so, const char* complaint) {
        if (!is_so && is_right()) failure_ = complaint;
    }
    bool is_right() const { return failure_.empty(); }
    bool is_at_end() const { return at_ == bytes_.size(); }
    std::span<const std::byte> take(std::size_t count) { // what is there of it
        const auto taken = bytes_.subspan(at_, std::min(count, bytes_.size() - at_));
        at_ += taken.size();
        return taken;
    }
    std::size_t at() const { return at_; }
    std::string error() const { return "byte " + std::to_string(at_) + ": " + failure_; }

private:
    std::span<const std::byte> bytes_;
    std::size_t at_ = 0;
    std::string failure_;
};

template <class Bytes>
void pass_point(Bytes& bytes, auto& p) {
    bytes.pass(p.x), bytes.pass(p.y), bytes.pass(p.z);
}

template <class Bytes>
void pass_corner(Bytes& bytes, auto& corner) {
    constexpr float largest = std::numeric_limits<float>::max();
    pass_point(bytes, corner.at);
    bytes.pass_size(corner.cameras, 8, selection_directions.size(), "cameras of a corner");
    for (auto& camera : corner.cameras) {
        bytes.pass(camera.loss);
        bytes.require(camera.loss >= -1 && camera.loss <= largest, "a loss is no number");
        bytes.pass_size(camera.objects, 6, any_count, "objects in sight");
        const SelectedLevel* before = nullptr;
        for (auto& object : camera.objects) {
            bytes.pass(object.object);
            bytes.pass(object.level);
            bytes.template pass_size<std::uint8_t>(object.costs, 4, most_levels - 1, "costs of an object");
            bytes.require(object.level <= object.costs.size(), "an object has no such level");
            bytes.require(!before || before->object < object.object, "objects are not in their order");
            before = &object;
            for (auto& cost : object.costs) {
                bytes.pass(cost);
                bytes.require(std::abs(cost) <= largest, "the cost of a level is no number");
            }
            if (!bytes.is_right()) return;
        }
    }
}

std::uint64_t hash_of(std::span<const std::byte> bytes) { return XXH3_64bits(bytes.data(), bytes.size()); }

bool is_within(const SelectionGrid& grid, const LatticePoint& p) {
    const std::int32_t size = grid.cell_size();
    return p.x >= 0 && p.y >= 0 && p.z >= 0 && p.x <= grid.cells.x * size && p.y <= grid.cells.y * size &&
           p.z <= grid.cells.z * size;
}

} // namespace

// ---- grids

std::vector<LatticePoint> corners_of(const SelectionGrid& grid, const SelectionCell& cell) {
    std::vector<LatticePoint> corners;
    for (const std::int32_t y : {0, 1}) {
        if (y == 1 && grid.is_on_ground()) break;
        for (const std::int32_t z : {0, 1})
            for (const std::int32_t x : {0, 1})
                corners.push_back({cell.at.x + x * cell.size, cell.at.y + y * cell.size, cell.at.z + z * cell.size});
    }
    return corners;
}

std::vector<SelectionCell> cells_of(const SelectionGrid& grid) {
    std::vector<SelectionCell> cells;
    const std::int32_t size = grid.cell_size();
    for (std::int32_t x = 0; x < grid.cells.x; ++x)
        for (std::int32_t y = 0; y < std::max(grid.cells.y, 1); ++y)
            for (std::int32_t z = 0; z < grid.cells.z; ++z) cells.push_back({{x * size, y * size, z * size}, size});
    return cells;
}

const SelectionCorner* Selections::Data::corner(const LatticePoint& at) const {
    const auto found = std::lower_bound(corners.begin(), corners.end(), at,
                                        [](const SelectionCorner& c, const LatticePoint& p) { return c.at < p; });
    return found != corners.end() && found->at == at ? &*found : nullptr;
}

bool corners_differ(std::span<const SelectionCorner* const> corners, double levels) {
    // By object: the finest level that each corner has for it; who does not see it takes the coarsest.
    struct Seen {
        int last = 0;
        std::vector<int> by_corner;
    };
    std::map<std::uint32_t, Seen> objects;
    for (std::size_t c = 0; c < corners.size(); ++c)
        for (const SelectionCamera& camera : corners[c]->cameras)
            for (const SelectedLevel& o : camera.objects) {
                Seen& seen = objects[o.object];
                seen.last = static_cast<int>(o.costs.size());
                seen.by_corner.resize(corners.size(), most_levels);
                seen.by_corner[c] = std::min(seen.by_corner[c], static_cast<int>(o.level));
            }
    double sum = 0;
    std::size_t count = 0;
    for (auto& [object, seen] : objects) {
        for (int& level : seen.by_corner) level = std::min(level, seen.last);
        const auto [finest, coarsest] = std::minmax_element(seen.by_corner.begin(), seen.by_corner.end());
        if (*finest == seen.last) continue;
        sum += *coarsest - *finest;
        ++count;
    }
    return count > 0 && sum / static_cast<double>(count) > levels;
}

std::uint64_t scene_fingerprint(const Scene& scene, std::span<const std::vector<std::uint32_t>> triangles) {
    ByteWriter all;
    for (const Object& object : scene.objects) {
        const vdtree::Similarity& p = object.placement;
        for (const double v : {p.scale, p.rotation.w, p.rotation.x, p.rotation.y, p.rotation.z, p.translation.x,
                               p.translation.y, p.translation.z})
            all.pass(v);
        all.pass(object.tree.triangle_count());
    }
    for (const auto& levels : triangles) {
        all.pass(static_cast<std::uint32_t>(levels.size()));
        for (const std::uint32_t count : levels) all.pass(count);
    }
    return hash_of(all.take());
}

namespace {

template <class Bytes>
void pass_grid(Bytes& bytes, auto& grid) {
    const auto is_finite = [](double v) { return std::abs(v) <= 1e12; };
    const auto in_range = [](std::int32_t n) { return n >= 1 && n <= most_grid_cells; };
    pass_point(bytes, grid.origin);
    bytes.pass(grid.step);
    pass_point(bytes, grid.cells);
    bytes.pass(grid.depth);
    bytes.require(is_finite(grid.origin.x) && is_finite(grid.origin.y) && is_finite(grid.origin.z),
                  "the grid's place is no number, or too far away");
    bytes.require(grid.step > 0 && grid.step <= 1e12, "the grid's step is not above 0");
    bytes.require(grid.depth >= 0 && grid.depth <= most_selection_depth, "cells are parted too often");
    bytes.require(in_range(grid.cells.x) && in_range(grid.cells.z) && (grid.cells.y == 0 || in_range(grid.cells.y)),
                  "the grid has no such number of cells");
}

// What comes before the corners, behind the magic and the version.
template <class Bytes>
void pass_head(Bytes& bytes, auto& s) {
    bytes.pass(s.quality);
    bytes.require(s.quality >= SelectionQuality::ssim && s.quality <= SelectionQuality::contrast,
                  "there is no such quality");
    bytes.pass(s.budget);
    bytes.pass(s.window_px);
    bytes.pass(s.levels);
    bytes.require(s.budget > 0, "the budget is 0");
    bytes.require(s.window_px >= 11 && s.window_px <= 8192, "the window has no such size");
    bytes.require(s.levels >= 2 && s.levels <= most_levels, "objects have no such number of levels");
    pass_grid(bytes, s.grid);
    bytes.pass(s.scene);
    bytes.pass_size(s.triangles, 8, any_count, "objects");
    for (auto& counts : s.triangles) {
        bytes.pass_size(counts, 4, static_cast<std::uint32_t>(s.levels), "levels of an object");
        bytes.require(!counts.empty(), "an object has no level");
        for (auto& count : counts) bytes.pass(count);
        bytes.require(std::ranges::adjacent_find(counts, std::less_equal()) == counts.end(),
                      "the triangles of an object's levels do not fall");
        if (!bytes.is_right()) return;
    }
}

template <class Bytes>
void pass_corners(Bytes& bytes, auto& s) {
    bytes.pass_size(s.corners, 16, most_selection_corners, "corners");
    const SelectionCorner* before = nullptr;
    for (auto& corner : s.corners) {
        pass_corner(bytes, corner);
        bytes.require(is_within(s.grid, corner.at), "a corner is not of the grid");
        bytes.require(!before || before->at < corner.at, "corners are not in their order");
        bytes.require(corner.cameras.size() == static_cast<std::size_t>(s.directions()),
                      "a corner has not as many cameras as there are directions");
        for (const SelectionCamera& camera : corner.cameras)
            for (const SelectedLevel& o : camera.objects)
                bytes.require(o.object < s.triangles.size() && o.costs.size() + 1 == s.triangles[o.object].size(),
                              "a camera sees an object, or a level of it, that there is not");
        if (!bytes.is_right()) return;
        before = &corner;
    }
}

template <class Bytes>
void pass_cells(Bytes& bytes, auto& s) {
    bytes.pass_size(s.cells, 16, most_selection_corners, "cells");
    const SelectionCell* before = nullptr;
    for (auto& cell : s.cells) {
        pass_point(bytes, cell.at);
        bytes.pass(cell.size);
        bytes.require(!before || *before < cell, "cells are not in their order");
        bytes.require(cell.size > 0 && cell.size <= s.grid.cell_size() && std::has_single_bit(unsigned(cell.size)) &&
                          is_within(s.grid, cell.at),
                      "a cell is not of the grid");
        if (!bytes.is_right()) return;
        for (const LatticePoint& p : corners_of(s.grid, cell))
            bytes.require(s.corner(p) != nullptr, "a corner of a cell is missing");
        before = &cell;
    }
    bytes.require(!s.cells.empty(), "there are no cells");
}

ByteWriter head_of(const Selections::Data& s) {
    ByteWriter out;
    out.pass(selection_magic);
    out.pass(selection_version);
    pass_head(out, s);
    return out;
}

} // namespace

// ---- files

std::vector<std::byte> to_bytes(const SelectionCorner& corner) {
    ByteWriter out;
    pass_corner(out, corner);
    return out.take();
}

Result<SelectionCorner> corner_from(std::span<const std::byte> bytes) {
    ByteReader in(bytes);
    SelectionCorner corner;
    pass_corner(in, corner);
    in.require(in.is_at_end(), "there is more than a corner");
    if (!in.is_right()) return Error{ErrorCode::malformed_data, "A corner of selections, " + in.error() + "."};
    return corner;
}

std::uint64_t search_key(const Selections::Data& selections) { return hash_of(head_of(selections).take()); }

Result<void> write_selections(const std::filesystem::path& file, const Selections::Data& s) {
    ByteWriter out = head_of(s);
    pass_corners(out, s);
    pass_cells(out, s);
    std::vector<std::byte> bytes = out.take();
    const std::uint64_t hash = hash_of(bytes);
    const auto tail = std::as_bytes(std::span(&hash, 1));
    bytes.insert(bytes.end(), tail.begin(), tail.end());
    auto target = vdtree::AtomicFile::create(file);
    if (!target) return target.error();
    if (auto written = target->write(bytes); !written) return written;
    return target->commit();
}

Result<Selections::Data> read_selections(const std::filesystem::path& file) {
    const auto read = read_file_or_pipe(file);
    if (!read) return read.error();
    const auto wrong = [&](const std::string& what) {
        return Error{ErrorCode::malformed_data, "'" + file.string() + "', " + what + "."};
    };
    const auto bytes = std::as_bytes(std::span(*read));
    Magic magic;
    std::uint32_t version = 0;
    std::uint64_t hash = 0;
    ByteReader start(bytes);
    start.pass(magic);
    start.pass(version);
    if (magic != selection_magic || bytes.size() < sizeof(magic) + sizeof(version) + sizeof(hash))
        return wrong("byte 0: this is no file of selections; make one with 'unseen levels precompute'");
    if (version != selection_version)
        return wrong("byte 8: version " + std::to_string(version) + " of the format, and this program reads " +
                     std::to_string(selection_version) + "; make it anew with 'unseen levels precompute'");
    const auto body = bytes.first(bytes.size() - sizeof(hash));
    std::memcpy(&hash, bytes.data() + body.size(), sizeof(hash));
    if (hash != hash_of(body))
        return wrong("byte " + std::to_string(body.size()) + ": it is damaged or cut short, its sum does not agree");
    ByteReader in(body.subspan(start.at()));
    Selections::Data s;
    pass_head(in, s);
    if (in.is_right()) pass_corners(in, s);
    if (in.is_right()) pass_cells(in, s);
    in.require(in.is_at_end(), "something follows the last cell");
    if (!in.is_right()) return wrong(in.error());
    return s;
}

Selections::Selections(Data data) : data_(std::make_shared<const Data>(std::move(data))) {}

int Selections::levels() const noexcept { return data_->levels; }

Result<Selections> Selections::read(const std::filesystem::path& file) {
    auto read = read_selections(file);
    return read ? Result<Selections>(Selections(std::move(*read))) : read.error();
}

// ---- journals

namespace {

// Reads the corners of a journal, if it is of this key: each record is its length, its sum, itself. Returns the bytes up
// to what is cut short or damaged.
std::size_t read_records(std::span<const std::byte> bytes, std::uint64_t key, std::vector<SelectionCorner>& done) {
    ByteReader in(bytes);
    Magic magic;
    std::uint64_t of = 0;
    in.pass(magic);
    in.pass(of);
    if (!in.is_right() || magic != journal_magic || of != key) return 0;
    for (std::size_t good = in.at();; good = in.at()) {
        std::uint64_t length = 0, sum = 0;
        in.pass(length);
        in.pass(sum);
        const auto record = in.take(length);
        if (!in.is_right() || record.size() < length || hash_of(record) != sum) return good;
        auto corner = corner_from(record);
        if (!corner) return good;
        done.push_back(std::move(*corner));
    }
}

Error cannot_write(const std::filesystem::path& file) {
    return {ErrorCode::io_failure, "Cannot write '" + file.string() + "', which keeps what is done."};
}

bool write(const std::filesystem::path& file, std::ios::openmode mode, ByteWriter& out) {
    const std::vector<std::byte> bytes = out.take();
    std::ofstream stream(file, std::ios::binary | mode);
    stream.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    return static_cast<bool>(stream.flush());
}

} // namespace

Result<SelectionJournal> SelectionJournal::open(const std::filesystem::path& file, std::uint64_t key) {
    SelectionJournal journal;
    journal.file_ = file;
    std::error_code failed;
    if (std::filesystem::exists(file, failed)) {
        const auto bytes = read_file_or_pipe(file);
        if (!bytes) return bytes.error();
        if (const auto good = read_records(std::as_bytes(std::span(*bytes)), key, journal.done_); good > 0) {
            std::filesystem::resize_file(file, good, failed);
            if (failed) return cannot_write(file);
            return journal;
        }
    }
    ByteWriter out;
    out.pass(journal_magic);
    out.pass(key);
    if (!write(file, std::ios::trunc, out)) return cannot_write(file);
    return journal;
}

Result<void> SelectionJournal::add(const SelectionCorner& corner) {
    const std::vector<std::byte> record = to_bytes(corner);
    ByteWriter out;
    out.pass(std::uint64_t{record.size()});
    out.pass(hash_of(record));
    for (const std::byte byte : record) out.pass(byte);
    if (!write(file_, std::ios::app, out)) return cannot_write(file_);
    return {};
}

void SelectionJournal::remove() const {
    std::error_code ignored;
    std::filesystem::remove(file_, ignored);
}

} // namespace unseen::session
