"""Reader of captures of SocketCAN: .pcap and .pcapng, as tcpdump, dumpcap and Wireshark write them."""
