// Which file a page belongs to, for handlers of the signal that a lost page raises.
#pragma once

namespace unseen::vdtree {

// The name of the file that is mapped at the address, as it was opened; null where there is none, or where more files
// are mapped than are noted, 32. Async-signal-safe.
const char* mapped_file_at(const void* address) noexcept;

} // namespace unseen::vdtree
