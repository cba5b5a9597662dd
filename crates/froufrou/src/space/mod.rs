//! What reaches each microphone: positions in, gains and delays out.
