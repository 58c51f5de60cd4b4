#include "process_team.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <sstream>
#include <string>
#include <vector>

namespace unseen::app {
namespace {

// FNV-1a over words instead of bytes: fast, and good enough against mistakes.
class Hash {
public:
    template <class T>
    void add(std::span<const T> values) {
        const auto bytes = std::as_bytes(values);
        add_word(bytes.size());
        std::size_t at = 0;
        for (; at < bytes.size(); at += sizeof(std::uint64_t)) {
            std::uint64_t word = 0;
            std::memcpy(&word, bytes.data() + at, std::min(sizeof(word), bytes.size() - at));
            add_word(word);
        }
    }
    void add_word(std::uint64_t word) { value_ = (value_ ^ word) * 0x100000001b3u; }
    std::uint64_t value() const { return value_; }

private:
    std::uint64_t value_ = 0xcbf29ce484222325u;
};

// Says of each member: nothing and its fingerprint, or what went wrong.
struct Statement {
    std::uint64_t fingerprint = 0;
    ErrorCode code = ErrorCode::io_failure;
    std::string complaint;
};

std::vector<std::byte> to_bytes(const Statement& s) {
    const std::string text =
        std::to_string(s.fingerprint) + " " + std::to_string(static_cast<int>(s.code)) + " " + s.complaint;
    const auto bytes = std::as_bytes(std::span(text));
    return {bytes.begin(), bytes.end()};
}

Statement to_statement(std::span<const std::byte> bytes) {
    std::istringstream text(std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
    Statement s;
    int code = 0;
    if (!(text >> s.fingerprint >> code)) return {.complaint = "A process of the team is another program."};
    s.code = static_cast<ErrorCode>(code);
    text.get(); // the blank
    std::getline(text, s.complaint, '\0');
    return s;
}

// What member 0 concludes from all statements.
Statement conclude(vdtree::Team& team, Statement own) {
    for (int other = 1; other < team.size(); ++other) {
        const Statement theirs = to_statement(team.receive(other));
        if (!own.complaint.empty()) continue; // but hear them all
        if (!theirs.complaint.empty()) {
            own.code = theirs.code;
            own.complaint = "Process " + std::to_string(other) + ": " + theirs.complaint;
        } else if (theirs.fingerprint != own.fingerprint) {
            own.code = ErrorCode::malformed_data;
            own.complaint = "Process " + std::to_string(other) +
                            " has read another mesh than process 0: give all the same file and options.";
        }
    }
    for (int other = 1; other < team.size(); ++other) team.send(other, to_bytes(own));
    return own;
}

} // namespace

std::uint64_t fingerprint(const vdtree::MeshView& mesh, const vdtree::BuildOptions& options) {
    Hash hash;
    hash.add(mesh.positions);
    hash.add(mesh.triangles);
    hash.add(mesh.normals);
    hash.add(mesh.colours);
    hash.add(mesh.uvs);
    hash.add(mesh.smoothing);
    hash.add(mesh.further);
    hash.add(mesh.weights);
    hash.add_word(static_cast<std::uint64_t>(options.clusterer));
    hash.add_word(std::bit_cast<std::uint32_t>(options.crease.value_or(-1.0f))); // never negative
    hash.add_word(std::bit_cast<std::uint32_t>(options.border_weight));
    return hash.value();
}

Result<void> agree(vdtree::Team& team, const Result<void>& own, std::uint64_t fingerprint) {
    Statement statement;
    statement.fingerprint = fingerprint;
    if (!own) statement.code = own.error().code, statement.complaint = own.error().message;
    if (team.rank() == 0) {
        statement = conclude(team, std::move(statement));
    } else {
        team.send(0, to_bytes(statement));
        statement = to_statement(team.receive(0));
    }
    if (!statement.complaint.empty()) return Error{statement.code, statement.complaint};
    return {};
}

} // namespace unseen::app
