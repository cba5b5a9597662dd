//! What the signal is: threads in, samples out, block by block.
