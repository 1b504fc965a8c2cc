#pragma once

#include <boost/container/deque.hpp>

namespace dynamic_slam {

// A list that grows for as long as a run lasts, hours or days. Its blocks are large: small ones, made now and
// then between landmarks and keyframes that come and go, would leave holes in the memory that nothing fits
// into.
template <class T>
using LongList =
    boost::container::deque<T, void,
                            boost::container::deque_options_t<boost::container::block_bytes<1u << 16>>>;

}  // namespace dynamic_slam
